// A controller with its page, a browser that shows it, and an observer at the controller's socket that is no browser.
import { spawn } from "node:child_process";
import { createConnection } from "node:net";
import { mkdtempSync, rmSync } from "node:fs";
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

// Waits for what has to come at last; how long it takes decides nothing.
export async function until(words, look, ms = 20000) {
  const end = Date.now() + ms;
  for (;;) {
    const found = await look();
    if (found) return found;
    if (Date.now() > end) throw new Error(`this did not come: ${words}`);
    await sleep(10);
  }
}

// tandem serve with its page, on a computer that may be late: what a browser leaves of it is not judged here.
export async function serve(machine, more = []) {
  const folder = mkdtempSync(join(tmpdir(), "tandem-page-"));
  const socket = join(folder, "socket");
  const child = spawn(TANDEM, ["serve", "--machine", machine, "--no-state", "--listen", socket, "--http", "127.0.0.1:0", "--set", "loops.max_missed_periods=1000", "--set", "loops.max_missed_share=1", ...more], { stdio: ["ignore", "ignore", "pipe"] });
  let said = "";
  const link = await new Promise((found, refuse) => {
    child.stderr.on("data", (data) => { said += data; const match = said.match(/http:\/\/\S+/); if (match) found(match[0]); });
    child.on("exit", () => refuse(new Error(said)));
  });
  const end = async () => {
    if (child.exitCode === null) { child.kill("SIGTERM"); await new Promise((over) => child.on("exit", over)); }
    rmSync(folder, { recursive: true, force: true });
  };
  return { link, socket, folder, end, child };
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
  await greeting;
  return { ask, events, end: () => socket.destroy() };
}

export function browse() {
  // Drawn by the processor, as on a computer without a graphics unit.
  const args = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
  return chromium.launch({ executablePath: CHROMIUM, args });
}

// A page of the controller, once it shows the machine; `before` runs in it before anything else.
export async function open(browser, link, { before, ...options } = {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
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

export async function take(page) {
  await page.click("#lease");
  await page.waitForFunction(() => window.tandem.hasLease);
}

// The largest of some echo times of the page, ms.
export function echo(page) {
  return page.evaluate(async () => {
    let most = 0;
    for (let i = 0; i < 30; i++) {
      const start = performance.now();
      await window.tandem.link.ask("status");
      most = Math.max(most, performance.now() - start);
    }
    return most;
  });
}

// The processes that draw pages and run their scripts: one of the page, and one that the browser keeps in store.
export async function renderersOf(browser) {
  const session = await browser.newBrowserCDPSession();
  const { processInfo } = await session.send("SystemInfo.getProcessInfo");
  return processInfo.filter((process) => process.type === "renderer").map((process) => process.id);
}
