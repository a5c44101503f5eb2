// The page's cases: node tests/page/run.mjs NAME runs one, and without a name those whose names come line by line, all in one browser;
// each ends with a line that begins with DONE. The Rust test beside this sets what it needs.
import { createInterface } from "node:readline";
import { jog } from "./jog.mjs";
import * as cases from "./cases.mjs";
import * as load from "./load.mjs";
import { pictures } from "./pictures.mjs";

const DONE = "\u0004";
const all = { jog, pictures, ...cases, ...load };

async function run([name, ...with_]) {
  try {
    await all[name](...with_);
    return true;
  } catch (error) {
    console.log(error.stack || String(error));
    return false;
  }
}

const named = process.argv.slice(2);
if (named.length > 0) process.exit((await run(named)) ? 0 : 1);
for await (const line of createInterface({ input: process.stdin })) {
  console.log(`${DONE}${(await run(line.split(" "))) ? "passed" : "failed"}`);
}
process.exit(0);
