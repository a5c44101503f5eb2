// A controller with its page, a browser that shows it, and an observer at the controller's socket that is no browser.
import { spawn } from "node:child_process";
import { createConnection } from "node:net";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";

const { TANDEM, CHROMIUM, MODULES } = process.env;
const require = createRequire(join(MODULES, "x.js"));
const { chromium } = require("playwright-core");
export const axeSource = () => require.resolve("axe-core/axe.min.js");

export const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

export function check(holds, words) {
  if (!holds) throw new Error(words);
}

// Nothing has gone wrong in a page.
export const clean = (page) => check(page.errors.length === 0, page.errors.join("\n"));

// How long a busy computer may take for anything.
const PATIENCE_MS = 120000;

// Waits for what has to come at last; how long it takes decides nothing.
export async function until(words, look, ms = PATIENCE_MS, every = 10) {
  const end = Date.now() + ms;
  for (;;) {
    const found = await look();
    if (found) return found;
    if (Date.now() > end) throw new Error(`this did not come: ${words}`);
    await sleep(every);
  }
}

// tandem serve with its page, on a computer that may be late: what a browser leaves of it is not judged here.
export async function serve(machine, more = []) {
  const folder = mkdtempSync(join(tmpdir(), "tandem-page-"));
  const socket = join(folder, "socket");
  const child = spawn(TANDEM, ["serve", "--machine", machine, "--no-state", "--listen", socket, "--http", "127.0.0.1:0", "--set", "loops.max_missed_periods=1000", "--set", "loops.max_missed_share=1", ...more], { stdio: ["ignore", "ignore", "pipe"] });
  let said = "";
  // One address, and another one for each further token.
  const addresses = 1 + more.filter((word) => word.endsWith("-token-file")).length;
  const links = await new Promise((found, refuse) => {
    child.stderr.on("data", (data) => { said += data; const all = said.match(/http:\/\/\S+(?=\s)/g) || []; if (all.length >= addresses) found(all); });
    child.on("exit", () => refuse(new Error(said)));
  });
  const end = async () => {
    if (child.exitCode === null) { child.kill("SIGTERM"); await new Promise((over) => child.on("exit", over)); }
    rmSync(folder, { recursive: true, force: true });
  };
  return { link: links[0], links, socket, folder, end, child };
}

// A client of the controller's socket.
export async function observer(path) {
  const socket = createConnection(path);
  const waiting = new Map(), events = [];
  let rest = "", lastId = 0, greet;
  const greeting = new Promise((heard) => { greet = heard; });
  socket.setEncoding("utf8");
  socket.on("data", (text) => {
    rest += text;
    const lines = rest.split("\n");
    rest = lines.pop();
    for (const line of lines.filter(Boolean)) {
      const told = JSON.parse(line);
      if (told.tandem) greet(told.tandem);
      else if (told.event) events.push(told);
      else if (waiting.has(told.id)) {
        const [answer, refuse] = waiting.get(told.id);
        waiting.delete(told.id);
        if (told.error) refuse(new Error(told.error.why)); else answer(told.ok);
      }
    }
  });
  const ask = (request, keys = {}) => new Promise((answer, refuse) => {
    const id = ++lastId;
    waiting.set(id, [answer, refuse]);
    socket.write(JSON.stringify({ id, request, ...keys }) + "\n");
  });
  const { client } = await greeting;
  return { ask, client, events, end: () => socket.destroy() };
}

let shared = null;

// The browser of all cases: each has contexts of its own, which know nothing of each other.
export async function browse() {
  if (shared && shared.isConnected()) return shared;
  // Drawn by the processor, as on a computer without a graphics unit; one case compares with WebGL. A name that is bound to this computer
  // is a stranger's.
  const args = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", `--host-resolver-rules=MAP ${STRANGER} 127.0.0.1`];
  shared = await chromium.launch({ executablePath: CHROMIUM, args });
  return shared;
}

export const STRANGER = "evil.example";

// Runs a case on a controller of its own, in the browser that all share.
export async function inside(machine, act, more = ["--programs", "examples/programs"]) {
  const [controller, browser] = await Promise.all([serve(machine, more), browse()]);
  try {
    const watch = await observer(controller.socket);
    await act({ controller, browser, watch });
    watch.end();
  } finally {
    await Promise.all(browser.contexts().map((context) => context.close()));
    await controller.end();
  }
}

// Waits until as many fine periods have passed for the machine.
export async function passes(watch, periods) {
  const from = (await watch.ask("status")).tick;
  await until("time passes for the machine", async () => (await watch.ask("status")).tick > from + periods);
}

// A page of the controller, once it shows the machine; `before` runs in it before anything else.
export async function open(browser, link, { before, ...options } = {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
  context.setDefaultTimeout(PATIENCE_MS);
  if (before) await context.addInitScript(before);
  const page = await context.newPage();
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("console", (message) => { if (message.type() === "error") errors.push(message.text()); });
  await page.goto(link);
  await ready(page);
  return Object.assign(page, { errors });
}

export async function ready(page) {
  await page.waitForFunction(() => window.tandem && window.tandem.status && window.tandem.described);
}

// Takes control. The controller may not have heard yet that the page before a reload is gone: then a second press takes it over.
export async function take(page) {
  await page.click("#lease");
  await page.waitForFunction(() => window.tandem.hasLease || document.getElementById("lease").dataset.how === "take-over");
  if (await page.evaluate(() => window.tandem.hasLease)) return;
  await page.click("#lease");
  await page.waitForFunction(() => window.tandem.hasLease);
}

// Some echo times of the page, ms.
export function echoes(page, count) {
  return page.evaluate(async (count) => {
    const all = [];
    for (let i = 0; i < count; i++) {
      const start = performance.now();
      await window.tandem.link.ask("status");
      all.push(performance.now() - start);
    }
    return all;
  }, count);
}

export function median(values) {
  return [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];
}

// The processor time of every task of the pages' main threads while something happens, ms: what else a computer does adds nothing
// to it, as it does to the time on the clock.
export async function tasks(browser, act) {
  const session = await browser.newBrowserCDPSession(), events = [];
  session.on("Tracing.dataCollected", ({ value }) => events.push(...value));
  await session.send("Tracing.start", { traceConfig: { includedCategories: ["toplevel"] }, transferMode: "ReportEvents" });
  await act();
  const complete = new Promise((done) => session.on("Tracing.tracingComplete", done));
  await session.send("Tracing.end");
  await complete;
  await session.detach();
  const main = new Set(events.filter(({ name, args }) => name === "thread_name" && args.name === "CrRendererMain").map(({ tid }) => tid));
  const all = events.filter(({ name, tid, tdur }) => name === "ThreadControllerImpl::RunTask" && main.has(tid) && tdur !== undefined);
  check(all.length > 0, "no task of a page was seen");
  return all.map(({ tdur }) => tdur / 1000);
}

// Processor time that the browser and a controller have taken, s.
export async function used(browser, controller) {
  const session = await browser.newBrowserCDPSession();
  const { processInfo } = await session.send("SystemInfo.getProcessInfo");
  await session.detach();
  const [, user, system] = readFileSync(`/proc/${controller.child.pid}/stat`, "utf8").match(/\) (?:\S+ ){11}(\d+) (\d+)/);
  return { browser: processInfo.reduce((sum, { cpuTime }) => sum + cpuTime, 0), controller: (Number(user) + Number(system)) / 100 };
}

// The processes that draw pages and run their scripts: one of the page, and one that the browser keeps in store.
export async function renderersOf(browser) {
  const session = await browser.newBrowserCDPSession();
  const { processInfo } = await session.send("SystemInfo.getProcessInfo");
  await session.detach();
  return processInfo.filter((process) => process.type === "renderer").map((process) => process.id);
}
