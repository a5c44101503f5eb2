// One case of the page's tests: node tests/page/run.mjs NAME. The Rust test beside this sets what it needs.
import { jog } from "./jog.mjs";
import * as cases from "./cases.mjs";

const [name, ...with_] = process.argv.slice(2);
try {
  if (name === "jog") await jog(...with_);
  else await cases[name](...with_);
} catch (error) {
  console.error(error.stack || String(error));
  process.exit(1);
}
process.exit(0);
