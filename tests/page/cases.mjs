// What the page promises beside the jog.
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { axeSource, browse, check, echo, observer, open, ready, renderersOf, serve, sleep, take, until } from "./bench.mjs";

const MACHINE = "examples/machines/mill-3axis-smooth.toml";
const PROGRAMS = ["--programs", "examples/programs"];

async function inside(machine, act, more = PROGRAMS) {
  const controller = await serve(machine, more);
  const browser = await browse();
  try {
    const watch = await observer(controller.socket);
    await act({ controller, browser, watch });
    watch.end();
  } finally {
    await browser.close();
    await controller.end();
  }
}

const state = (page) => page.evaluate(() => document.body.dataset.state);
const clean = (page) => check(page.errors.length === 0, page.errors.join("\n"));

// From the program's name to its end, by the buttons of the page alone; a second page looks on, and changes nothing.
export async function program() {
  await inside(MACHINE, async ({ controller, browser, watch }) => {
    const page = await open(browser, controller.link);
    check((await page.getAttribute("#start", "aria-disabled")) === "true", "a page without control can start");
    await page.click("#start", { force: true });
    await take(page);
    await page.click("#tab-programs");
    await page.click("text=serpentine.ngc");
    await page.waitForFunction(() => window.tandem.status.program === "serpentine.ngc");
    // There is time to look at it.
    await page.locator("#feed-override").fill("10");
    await page.click("#start");
    await until("it runs", async () => (await state(page)) === "running");
    const second = await open(browser, controller.link);
    await until("the second page sees it", async () => (await state(second)) === "running");
    await second.click("#abort", { force: true });
    await second.click("#lease");
    check(!(await second.evaluate(() => window.tandem.hasLease)), "a second page took control");
    await page.click("#hold");
    await until("it is held", async () => (await state(page)) === "held");
    const place = (await watch.ask("status")).position;
    await second.reload();
    await ready(second);
    await until("a reload shows the truth", async () => (await state(second)) === "held");
    await second.close();
    await sleep(300);
    check(JSON.stringify((await watch.ask("status")).position) === JSON.stringify(place), "a page that went away moved the machine");
    // A reload of the page in control gives control back and starts nothing.
    await page.reload();
    await ready(page);
    await until("a reload shows the truth", async () => (await state(page)) === "held");
    check(!(await page.evaluate(() => window.tandem.hasLease)), "a reload kept control");
    await take(page);
    await page.locator("#feed-override").fill("100");
    await page.click("#start");
    await until("it is done", async () => (await watch.ask("status")).state === "ready");
    const { jobs } = await watch.ask("history");
    check(jobs.length === 1 && jobs[0].outcome === "done", JSON.stringify(jobs));
    clean(page);
  });
}

// A click on hold is with the fine loop as soon as anything that the page says.
export async function hold() {
  await inside(MACHINE, async ({ controller, browser, watch }) => {
    const page = await open(browser, controller.link);
    await take(page);
    await watch.ask("status");
    const delays = [];
    // While the machine moves, as at the click: there is more to draw then.
    let most = 0;
    for (let i = 0; i < 5; i++) {
      await page.evaluate(() => window.tandem.link.ask("mdi", { line: `G1 X${200 * (window.side = -(window.side || 1))} F3000` }));
      await until("it moves", async () => (await watch.ask("status")).feed_mm_per_min > 100);
      most = Math.max(most, await echo(page));
      await page.evaluate(() => {
        const ask = window.tandem.link.ask.bind(window.tandem.link);
        document.getElementById("hold").addEventListener("click", (event) => { window.clicked = event.timeStamp; }, { once: true, capture: true });
        window.tandem.link.ask = (request, keys) => {
          const answer = ask(request, keys);
          if (request === "hold") answer.then((told) => { window.answered = performance.now(); window.tick = told.tick; });
          return answer;
        };
      });
      await page.click("#hold");
      await page.waitForFunction(() => window.answered > window.clicked);
      delays.push(await page.evaluate(() => window.answered - window.clicked));
      await until("it is held", async () => (await watch.ask("status")).state === "held");
      await page.evaluate(() => window.tandem.link.ask("abort"));
      await until("it rests", async () => (await watch.ask("status")).state === "ready");
    }
    const best = Math.min(...delays);
    console.log(`hold: ${delays.map((ms) => ms.toFixed(1)).join(", ")} ms from click to answer; echo at most ${most.toFixed(1)} ms`);
    check(best <= most + 20, `the fastest of five took ${best} ms`);
    clean(page);
  });
}

// Lines by hand with what became of them, touch-off, a tool, an override; a refusal is said in words.
export async function hand() {
  await inside(MACHINE, async ({ controller, browser, watch }) => {
    const page = await open(browser, controller.link);
    await take(page);
    await page.click("#tab-mdi");
    const line = page.locator("[aria-label='Line by hand']");
    await line.fill("G1 X12.5 Y3 F3000");
    await line.press("Enter");
    await until("it is driven", async () => (await page.textContent(".log")).includes("driven"));
    await until("it rests", async () => (await watch.ask("status")).state === "ready");
    await line.fill("G1 X9999 F100");
    await line.press("Enter");
    await until("it is refused", async () => (await page.textContent(".log")).includes("refused"));
    check((await line.inputValue()) === "G1 X9999 F100", "what was refused is lost");
    await line.press("ArrowUp");
    await line.press("ArrowUp");
    check((await line.inputValue()) === "G1 X12.5 Y3 F3000", "the line before does not come back");
    await page.click("#tab-offsets");
    await page.fill("[aria-label='X is']", "2");
    await page.click("text=Set X");
    await until("the offset is set", async () => (await watch.ask("status")).work_position.x_mm === 2);
    await until("the page shows it", async () => (await page.textContent("#axes")).includes("2.000"));
    await page.click("#tab-tools");
    await page.fill("[aria-label='Tool number']", "7");
    await page.fill("[aria-label='Length offset in mm']", "41.5");
    await page.click("#panel-tools >> text=Set");
    await until("the tool is there", async () => (await watch.ask("tables")).tools.some((tool) => tool.number === 7 && tool.offset.z_mm === 41.5));
    await page.locator("#feed-override").fill("60");
    await until("the override is told", async () => (await watch.ask("status")).feed_override === 0.6);
    clean(page);
  });
}

// The software stop needs no control; the fault that follows is told with what to do, and is taken back.
export async function stop() {
  await inside(MACHINE, async ({ controller, browser, watch }) => {
    const page = await open(browser, controller.link);
    check((await page.textContent("#stop")).includes("Software stop"), "the stop is not called what it is");
    await page.click("#stop");
    await until("it has stopped", async () => (await state(page)) === "emergency-stop");
    check((await page.textContent("#next")).includes("reset"), "it is not said what to do");
    await page.click("#next-action");
    await until("it is ready", async () => (await watch.ask("status")).state === "ready");
    await until("the page shows it", async () => (await state(page)) === "ready");
    clean(page);
  });
}

// Every error of a program with its line; nothing is loaded by that.
export async function errors() {
  await inside(MACHINE, async ({ controller, browser, watch }) => {
    const page = await open(browser, controller.link);
    await take(page);
    await page.click("#tab-programs");
    const choose = async (name, text) => page.setInputFiles("input[type='file']", { name, mimeType: "text/plain", buffer: Buffer.from(text) });
    await choose("bad.ngc", "G21 G90\nG1 X9000 F100\nG3 X30 Y5 I5\nM2\n");
    await until("the errors are listed", async () => (await page.locator(".errors .bad, .errors li").count()) >= 2);
    const words = await page.textContent("#panel-programs .errors");
    check(words.includes(":2:") && words.includes(":3:"), words);
    check((await watch.ask("status")).program === null, "it was loaded");
    await choose("good.ngc", "G21 G90\nG1 X5 F600\nM2\n");
    await until("it is loaded", async () => (await watch.ask("status")).program === "good.ngc");
    clean(page);
  });
}

// A controller that was started anew has another token: the page of the old one is refused, and says so.
export async function token() {
  await inside(MACHINE, async ({ controller, browser }) => {
    const context = await browser.newContext();
    const page = await context.newPage();
    for (const address of [controller.link.split("#")[0], controller.link.replace(/token=.*/, "token=ffffffffffffffffffffffffffffffff")]) {
      await page.goto("about:blank");
      await page.goto(address);
      await page.waitForFunction(() => document.getElementById("next").textContent.includes("token"));
      check(await page.evaluate(() => !window.tandem.link.isOpen), "it is let in");
    }
    await page.goto("about:blank");
    await page.goto(controller.link);
    await ready(page);
    check(!(await page.evaluate(() => location.hash)).includes("token"), "the token stays in the address");
  });
}

// No serious finding of axe-core, in both themes, on a screen and on a tablet; and everything by the keyboard.
export async function access() {
  await inside(MACHINE, async ({ controller, browser, watch }) => {
    for (const colorScheme of ["dark", "light"]) {
      for (const [width, height] of [[1280, 800], [768, 1024]]) {
        const page = await open(browser, controller.link, { colorScheme, viewport: { width, height } });
        for (const panel of ["jog", "mdi", "programs", "offsets", "tools", "history"]) {
          await page.click("#tab-" + panel);
          await sleep(100);
          await page.addScriptTag({ path: axeSource() }).catch(async () => page.evaluate(await source()));
          const found = await page.evaluate(() => window.axe.run({ resultTypes: ["violations"] }));
          const serious = found.violations.filter((one) => ["serious", "critical"].includes(one.impact));
          check(serious.length === 0, `${colorScheme} ${width} ${panel}: ` + JSON.stringify(serious.map((one) => [one.id, one.help, one.nodes.slice(0, 4).map((node) => [node.html.slice(0, 160), node.any.map((any) => any.message)])]), null, 1));
        }
        const wide = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
        check(wide <= 0, `${width}: it is ${wide} pixels too wide`);
        await page.close();
      }
    }
    const page = await open(browser, controller.link);
    const press = async (target, key = "Enter") => {
      for (let i = 0; i < 120; i++) {
        if (await page.evaluate((target) => document.activeElement.matches(target), target)) { await page.keyboard.press(key); return; }
        await page.keyboard.press("Tab");
      }
      throw new Error(`${target} is not reached by the keyboard`);
    };
    await page.click("#tab-history");
    await press("#lease");
    await page.waitForFunction(() => window.tandem.hasLease);
    await press("#tab-history", "ArrowRight");
    await press("#tab-jog", "Tab");
    await press(".pad", "ArrowUp");
    await page.keyboard.down("ArrowRight");
    await until("it moves", async () => (await watch.ask("status")).position.x_mm > 1);
    await page.keyboard.up("ArrowRight");
    await until("it rests", async () => (await watch.ask("status")).state === "ready");
    await press("#stop");
    await until("it has stopped", async () => (await watch.ask("status")).state === "emergency-stop");
    clean(page);
  });
}

async function source() {
  const { readFileSync } = await import("node:fs");
  return readFileSync(axeSource(), "utf8");
}

// A program of 300 000 lines is drawn while the page stays at hand, by the processor alone.
export async function many() {
  const folder = mkdtempSync(join(tmpdir(), "tandem-many-"));
  const lines = ["G21 G90 F3000"];
  for (let i = 0; i < 300000; i++) lines.push(`X${(100 * Math.cos(i * 0.05)).toFixed(2)} Y${(100 * Math.sin(i * 0.0513)).toFixed(2)}`);
  lines[1] = "G1 " + lines[1];
  writeFileSync(join(folder, "many.ngc"), lines.join("\n") + "\nM2\n");
  try {
    await inside("examples/machines/mill-3axis.toml", async ({ controller, browser, watch }) => {
      const page = await open(browser, controller.link);
      await watch.ask("lease", { how: "take" });
      await page.evaluate(() => {
        window.longest = 0;
        new PerformanceObserver((list) => { for (const task of list.getEntries()) window.longest = Math.max(window.longest, task.duration); }).observe({ type: "longtask" });
      });
      await watch.ask("load", { path: "many.ngc" });
      const start = Date.now();
      await page.waitForFunction(() => window.tandem.drawnLines >= 300000, null, { timeout: 60000 });
      const seconds = (Date.now() - start) / 1000;
      const session = await page.context().newCDPSession(page);
      await session.send("Performance.enable");
      const { metrics } = await session.send("Performance.getMetrics");
      const heap = metrics.find(({ name }) => name === "JSHeapUsedSize").value / 1e6;
      const longest = await page.evaluate(() => window.longest);
      console.log(`300 000 lines: drawn in ${seconds.toFixed(1)} s, heap ${heap.toFixed(0)} MB, longest task ${longest.toFixed(0)} ms`);
      check(heap <= 250, `the heap has ${heap} MB`);
      clean(page);
    }, ["--programs", folder]);
  } finally {
    rmSync(folder, { recursive: true, force: true });
  }
}

// A page that reads nothing for a while loses frames and says so; the machine and other clients go on without it.
export async function slow() {
  await inside(MACHINE, async ({ controller, browser, watch }) => {
    const page = await open(browser, controller.link);
    await page.waitForFunction(() => window.tandem.scoped);
    await watch.ask("lease", { how: "take" });
    await watch.ask("load", { text: `G21 G90 F1500\n${"G1 X20\nG1 X0\n".repeat(40)}M2\n`, name: "to and fro" });
    await watch.ask("start");
    await until("it runs", async () => (await watch.ask("status")).state === "running");
    const renderers = await renderersOf(browser);
    renderers.forEach((renderer) => process.kill(renderer, "SIGSTOP"));
    const before = (await watch.ask("status")).tick;
    await until("ten seconds have passed for the machine", async () => (await watch.ask("status")).tick > before + 10000, 60000);
    renderers.forEach((renderer) => process.kill(renderer, "SIGCONT"));
    await until("it is said that frames are lost", async () => (await page.textContent("#scope-lost")).includes("lost"));
    check((await watch.ask("status")).state === "running", "the machine waited for the page");
    console.log(await page.textContent("#scope-lost"));
    clean(page);
  });
}

// The pictures of the documentation: node tests/page/run.mjs pictures FOLDER.
export async function pictures(folder = "docs/pictures") {
  mkdirSync(folder, { recursive: true });
  await inside(MACHINE, async ({ controller, browser, watch }) => {
    const page = await open(browser, controller.link, { colorScheme: "dark", viewport: { width: 1440, height: 900 } });
    await take(page);
    await page.click("#tab-programs");
    await page.click("text=serpentine.ngc");
    await page.waitForFunction(() => window.tandem.status.program === "serpentine.ngc");
    await page.locator("#feed-override").fill("60");
    await page.click("#tab-jog");
    await page.click("#start");
    await until("it is half done", async () => (await watch.ask("status")).progress > 0.6);
    await page.screenshot({ path: join(folder, "operator-page.png") });
  });

}
