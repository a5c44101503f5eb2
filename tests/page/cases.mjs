// What the page promises beside the jog.
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
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

// A click on hold is said in the click itself, before anything else. On a quiet computer (TANDEM_QUIET=1) it is also with the fine loop
// as soon as anything that the page says while it has nothing to draw: moving, drawing and telemetry stand in nobody's way.
export async function hold() {
  await inside(MACHINE, async ({ controller, browser, watch }) => {
    const page = await open(browser, controller.link);
    await take(page);
    const still = await echo(page);
    const delays = [];
    for (let i = 0; i < 7; i++) {
      await page.evaluate(() => window.tandem.link.ask("mdi", { line: `G1 X${200 * (window.side = -(window.side || 1))} F3000` }));
      await until("it moves", async () => (await watch.ask("status")).feed_mm_per_min > 100);
      await page.evaluate(() => {
        const ask = window.tandem.link.ask.bind(window.tandem.link);
        window.said = [];
        document.getElementById("hold").addEventListener("click", (event) => {
          [window.clicked, window.said, window.inClick] = [event.timeStamp, [], true];
          setTimeout(() => { window.inClick = false; });
        }, { once: true, capture: true });
        window.tandem.link.ask = (request, keys) => {
          const answer = ask(request, keys);
          window.said.push(request);
          if (request === "hold") {
            window.atOnce = window.inClick;
            answer.then((told) => { window.answered = performance.now(); window.tick = told.tick; });
          }
          return answer;
        };
      });
      await page.click("#hold");
      await page.waitForFunction(() => window.answered > window.clicked);
      delays.push(await page.evaluate(() => window.answered - window.clicked));
      check(await page.evaluate(() => window.said[0] === "hold"), "something is said between the click and hold");
      check(await page.evaluate(() => window.atOnce), "hold is said after the click is over");
      await until("it is held", async () => (await watch.ask("status")).state === "held");
      await page.evaluate(() => window.tandem.link.ask("abort"));
      await until("it rests", async () => (await watch.ask("status")).state === "ready");
    }
    const best = Math.min(...delays);
    console.log(`hold: ${delays.map((ms) => ms.toFixed(1)).join(", ")} ms from click to answer; echo at rest ${still.toFixed(1)} ms`);
    if (process.env.TANDEM_QUIET) check(best <= still + 20, `the fastest of seven took ${best} ms`);
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
    const [screen, tablet] = [[1280, 800], [768, 1024]];
    const all = [["dark", screen], ["light", tablet], ["dark", tablet], ["light", screen]];
    // Colours are judged in both themes and sizes on both screens; TANDEM_QUIET has the time for each with each.
    for (const [colorScheme, [width, height]] of process.env.TANDEM_QUIET ? all : all.slice(0, 2)) {
      const page = await open(browser, controller.link, { colorScheme, viewport: { width, height } });
      for (const panel of ["jog", "mdi", "programs", "offsets", "tools", "history", "capture", "machine"]) {
        await page.click("#tab-" + panel);
        await sleep(100);
        await page.addScriptTag({ path: axeSource() }).catch(async () => page.evaluate(source()));
        const found = await page.evaluate(() => window.axe.run({ resultTypes: ["violations"] }));
        const serious = found.violations.filter((one) => ["serious", "critical"].includes(one.impact));
        check(serious.length === 0, `${colorScheme} ${width} ${panel}: ` + JSON.stringify(serious.map((one) => [one.id, one.help, one.nodes.slice(0, 4).map((node) => [node.html.slice(0, 160), node.any.map((any) => any.message)])]), null, 1));
      }
      const wide = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
      check(wide <= 0, `${width}: it is ${wide} pixels too wide`);
      await page.close();
    }
    const page = await open(browser, controller.link);
    const press = async (target, key = "Enter") => {
      for (let i = 0; i < 120; i++) {
        if (await page.evaluate((target) => document.activeElement.matches(target), target)) { await page.keyboard.press(key); return; }
        await page.keyboard.press("Tab");
      }
      throw new Error(`${target} is not reached by the keyboard`);
    };
    await page.click("#tab-machine");
    await press("#lease");
    await page.waitForFunction(() => window.tandem.hasLease);
    await press("#tab-machine", "ArrowRight");
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

const source = () => readFileSync(axeSource(), "utf8");

const LINES = process.env.TANDEM_QUIET ? 300000 : 100000;

// A program of many lines is drawn while the page stays at hand, by the processor alone: each line is told once and drawn once. On a
// quiet computer TANDEM_QUIET asks for 300 000 lines, and for the times.
export async function many() {
  const folder = mkdtempSync(join(tmpdir(), "tandem-many-"));
  const lines = ["G21 G90 F3000"];
  for (let i = 0; i < LINES; i++) lines.push(`X${(100 * Math.cos(i * 0.05)).toFixed(2)} Y${(100 * Math.sin(i * 0.0513)).toFixed(2)}`);
  lines[1] = "G1 " + lines[1];
  writeFileSync(join(folder, "many.ngc"), lines.join("\n") + "\nM2\n");
  try {
    await inside("examples/machines/mill-3axis.toml", async ({ controller, browser, watch }) => {
      const page = await open(browser, controller.link);
      await watch.ask("lease", { how: "take" });
      await page.evaluate(() => {
        window.tasks = [];
        new PerformanceObserver((list) => { for (const task of list.getEntries()) window.tasks.push(task.duration); }).observe({ type: "longtask" });
        const ask = window.tandem.link.ask.bind(window.tandem.link);
        window.answers = 0;
        window.tandem.link.ask = (request, keys) => { if (request === "path") window.answers++; return ask(request, keys); };
      });
      const takeTasks = () => page.evaluate(() => { const all = window.tasks; window.tasks = []; return all; });
      // The program is checked meanwhile, which keeps the computer as busy as drawing does.
      await takeTasks();
      await watch.ask("load", { path: "many.ngc" });
      const quiet = Math.max(0, ...(await takeTasks()));
      const start = Date.now();
      await page.waitForFunction((lines) => window.tandem.drawnPoints >= lines, LINES, { timeout: 120000 });
      const seconds = (Date.now() - start) / 1000;
      const longest = Math.max(0, ...(await takeTasks()));
      const session = await page.context().newCDPSession(page);
      await session.send("Performance.enable");
      const { metrics } = await session.send("Performance.getMetrics");
      const heap = metrics.find(({ name }) => name === "JSHeapUsedSize").value / 1e6;
      const { answers, painted, points } = await page.evaluate(() => ({ answers: window.answers, painted: window.tandem.paintedPoints, points: window.tandem.drawnPoints }));
      console.log(`${LINES} lines: drawn in ${seconds.toFixed(1)} s, heap ${heap.toFixed(0)} MB, longest task ${longest.toFixed(0)} ms (${quiet.toFixed(0)} ms before), ${answers} answers, ${(painted / points).toFixed(2)} times painted`);
      check(heap <= 250, `the heap has ${heap} MB`);
      check(answers <= 120, `${answers} answers for ${points} points`);
      check(painted <= 2 * points, `${painted} points painted for ${points}`);
      if (process.env.TANDEM_QUIET) check(seconds <= 4 && longest <= 200, `${seconds} s, ${longest} ms`);
      clean(page);
    }, ["--programs", folder]);
  } finally {
    rmSync(folder, { recursive: true, force: true });
  }
}

const SCRIPTED = ["--set", "planner.plugin=block-overlap", "--set", "planner.options.corner_control=off", "--set", "motion.time_constant_ms=50",
  "--set", "policy.script=scripts/policies/corner-time-constant.wasm", "--programs", "examples/policies"];

// A parameter of the policy is turned within its bounds, and the page says what the next run made of it.
export async function bench() {
  await inside("examples/machines/mill-3axis.toml", async ({ controller, browser, watch }) => {
    const page = await open(browser, controller.link);
    await take(page);
    await page.click("#tab-programs");
    await page.click("text=corners.ngc");
    await page.waitForFunction(() => window.tandem.status.program === "corners.ngc");
    await page.click("#tab-tuning");
    const turned = page.locator("#panel-tuning input[type=number][aria-label=corner_error_um]");
    const [lowest, highest] = [Number(await turned.getAttribute("min")), Number(await turned.getAttribute("max"))];
    check(lowest < highest, `the bounds are ${lowest} to ${highest}`);
    // A computer that was too late in a run has made it longer.
    let inTime = true;
    const late = async () => {
      const { missed_periods, starvations, late_ratios } = (await watch.ask("status")).counters;
      return missed_periods + starvations + late_ratios;
    };
    const run = async (value) => {
      const before = await late();
      const cells = await runInAnyTime(value);
      inTime &&= (await late()) === before;
      return cells;
    };
    const runInAnyTime = async (value) => {
      await turned.fill(String(value));
      await page.click("[data-name=corner_error_um] >> text=Set");
      await until("it is set", async () => (await watch.ask("policy-parameters")).parameters.corner_error_um === value);
      const before = await page.locator("#runs tbody tr").count();
      await page.click("#start");
      await until("the run is told", async () => (await page.locator("#runs tbody tr").count()) > before, 60000);
      await until("it rests", async () => (await watch.ask("status")).state === "ready");
      const cells = await page.locator("#runs tbody tr").first().locator("td").allTextContents();
      check((await page.locator("#runs tbody tr").nth(1).textContent()).includes(`corner_error_um ${value}`), "it is not said with what it ran");
      return cells.slice(1).map((words) => parseFloat(words));
    };
    await turned.fill(String(highest * 2));
    await page.click("[data-name=corner_error_um] >> text=Set");
    await until("what is out of bounds is refused", async () => (await page.textContent("#says")).includes("must be from"));
    const [coarse, fine] = [await run(100), await run(20)];
    console.log(`corner_error_um 100: ${coarse}; 20: ${fine} (s, % of the jerk limit, µm off the path)${inTime ? "" : ", and late"}`);
    check(fine[2] < coarse[2], `${coarse} ${fine}`);
    if (inTime) {
      check(fine[0] > coarse[0], `${coarse} ${fine}`);
      check((await page.locator("#runs tbody tr").first().textContent()).includes("+"), "the change is not shown");
    }
    clean(page);
  }, SCRIPTED);
}

// Signals are chosen, at most eight; a trigger is armed, and what lies around it is shown until somebody looks at what comes again.
export async function capture() {
  await inside(MACHINE, async ({ controller, browser }) => {
    const page = await open(browser, controller.link);
    await take(page);
    await page.waitForFunction(() => window.tandem.scoped);
    await page.click("#tab-capture");
    for (const name of ["feed_mm_s", "x_following_mm", "sigma", "line", "block", "x_fb_mm", "y_fb_mm", "z_fb_mm"]) {
      await page.click(`.checks label:text-is("${name}")`);
    }
    await until("eight are plotted", async () => (await page.locator("#scope-keys span").count()) === 8);
    await page.click(".checks label:text-is(\"ratio\")");
    check((await page.locator("#scope-keys span").count()) === 8, "a ninth signal is plotted");
    await page.waitForFunction(() => window.tandem.scoped);
    await page.selectOption("[aria-label='Signal of the trigger']", "feed_mm_s");
    await page.fill("[aria-label='Level']", "5");
    await page.fill("[aria-label='Seconds before']", "0.1");
    await page.fill("[aria-label='Seconds after']", "0.2");
    await page.click("#panel-capture >> text=Arm");
    await until("it is armed", async () => (await page.textContent("#panel-capture [role=status]")).startsWith("Armed"));
    await page.evaluate(() => window.tandem.link.ask("mdi", { line: "G1 X20 F1200" }));
    await until("it is captured", async () => (await page.textContent("#panel-capture [role=status]")).startsWith("Captured"));
    check((await page.textContent("#scope-hold")) === "Captured", "the picture does not say that it stands");
    const samples = Number((await page.textContent("#panel-capture [role=status]")).match(/\d+/)[0]);
    check(samples > 200 && samples <= 310, `${samples} samples`);
    await page.click("#scope-hold");
    await until("what comes is shown again", async () => (await page.textContent("#scope-hold")) === "Freeze");
    clean(page);
  });
}

// An alarm stays until somebody says that it was seen; plugins, limits, inputs and outputs are told.
export async function alarms() {
  await inside("examples/machines/mill-probe.toml", async ({ controller, browser, watch }) => {
    const page = await open(browser, controller.link);
    await take(page);
    await page.click("#stop");
    await until("it is an alarm", async () => (await page.textContent("#alarms")) === "1 alarm");
    await until("nothing is driven", async () => (await page.textContent("#feed")) === "0");
    await page.click("#next-action");
    await until("it is ready", async () => ["ready", "homing-needed"].includes((await watch.ask("status")).state));
    check((await page.textContent("#alarms")) === "1 alarm", "a reset has acknowledged it");
    await page.click("#alarms");
    await page.click("#panel-history >> text=Acknowledge all");
    await until("it is acknowledged", async () => (await watch.ask("alarms")).alarms.length === 0);
    await until("the page shows it", async () => (await page.getAttribute("#alarms", "class")) === "none");
    await page.click("#tab-machine");
    const words = await page.textContent("#panel-machine");
    for (const name of ["planner", "look-ahead", "driver", "sim", "kinematics"]) check(words.includes(name), `${name}: ${words}`);
    clean(page);
  });
}

// A token that lets look, and stop, and nothing else: what it does not allow is grey and says so.
export async function looker() {
  await inside(MACHINE, async ({ controller, browser, watch }) => {
    const context = await browser.newContext({ viewport: { width: 1280, height: 800 } });
    const page = Object.assign(await context.newPage(), { errors: [] });
    page.on("pageerror", (error) => page.errors.push(error.message));
    // The controller tells in its greeting what the client may.
    await page.routeWebSocket(/socket/, (route) => {
      const server = route.connectToServer();
      server.onMessage((message) => route.send(String(message).replace('"role":"set-up"', '"role":"watch"')));
    });
    await page.goto(controller.link);
    await ready(page);
    await until("it looks on", async () => (await page.textContent("#lease")) === "Looks on");
    for (const id of ["lease", "start", "single-block"]) check((await page.getAttribute("#" + id, "aria-disabled")) === "true", `${id} can be pressed`);
    check(await page.isDisabled("#feed-override"), "the override can be turned");
    await page.click("#lease", { force: true });
    await until("it says why", async () => (await page.textContent("#says")).includes("lets it look"));
    check(!(await page.evaluate(() => window.tandem.hasLease)), "it took control");
    await page.click("#stop");
    await until("it has stopped", async () => (await watch.ask("status")).state === "emergency-stop");
    check(await page.isHidden("#next-action"), "it may reset");
    clean(page);
  });
}

const TABS = 8;
// Seconds; the long run asks for 600.
const TABS_FOR_S = Number(process.env.TANDEM_TABS_S || 9);

// Eight pages, each with eight signals of every period: the controller that serves them misses no more periods than one beside it that
// serves nobody, and neither it nor they grow.
export async function tabs() {
  const loop = `G21 G90 F2000\n${"G1 X20 Y10\nG1 X0 Y0\n".repeat(Math.ceil(TABS_FOR_S * 3))}M2\n`;
  const beside = await serve(MACHINE);
  const alone = await observer(beside.socket);
  try {
    await inside(MACHINE, async ({ controller, browser, watch }) => {
      const pages = [];
      for (let i = 0; i < TABS; i++) {
        const signals = () => localStorage.setItem("signals", JSON.stringify(["x_cmd_mm", "y_cmd_mm", "z_cmd_mm", "x_fb_mm", "y_fb_mm", "z_fb_mm", "feed_mm_s", "sigma"]));
        const page = await open(browser, controller.link, { before: signals });
        await page.selectOption("#scope-what", "signals");
        pages.push(page);
      }
      const clients = [watch, alone];
      for (const client of clients) {
        await client.ask("lease", { how: "take" });
        await client.ask("load", { text: loop, name: "to and fro" });
      }
      const tickNow = async (client) => (await client.ask("status")).tick;
      for (const client of clients) await client.ask("start");
      const look = async () => {
        const heaps = [];
        for (const page of pages) {
          const session = await page.context().newCDPSession(page);
          await session.send("HeapProfiler.collectGarbage");
          const { usedSize } = await session.send("Runtime.getHeapUsage");
          heaps.push(usedSize / 1e6);
          await session.detach();
        }
        const resident = Number(readFileSync(`/proc/${controller.child.pid}/status`, "utf8").match(/VmRSS:\s+(\d+)/)[1]) / 1e3;
        return { heaps, resident };
      };
      const long = TABS_FOR_S * 1000;
      await until("a third is driven", async () => (await tickNow(watch)) > long / 3, long + 60000);
      const first = await look();
      await until("all is driven", async () => (await tickNow(watch)) > long, long * 2 + 60000);
      const last = await look();
      const rows = await Promise.all(pages.map((page) => page.evaluate(() => window.tandem.scopedRows)));
      const missed = [];
      for (const client of clients) {
        await client.ask("abort");
        const job = await until("the job is told", async () => client.events.find((told) => told.event === "job"));
        missed.push(job.summary.missed_periods / job.summary.samples);
      }
      const most = (values) => Math.max(...values).toFixed(1);
      console.log(`${TABS} pages, ${TABS_FOR_S} s: missed ${(missed[0] * 100).toFixed(2)} % of the periods, ${(missed[1] * 100).toFixed(2)} % beside; heap ${most(first.heaps)} then ${most(last.heaps)} MB, controller ${first.resident.toFixed(1)} then ${last.resident.toFixed(1)} MB; rows ${rows}`);
      check(rows.every((count) => count > 0), `a page has seen nothing: ${rows}`);
      // Two processes of one computer differ by what the system gives each, and on a busy one by more.
      const share = process.env.TANDEM_QUIET ? 0.01 : 0.2;
      check(missed[0] <= 1.1 * missed[1] + share, `missed ${missed[0]} of the periods, ${missed[1]} beside`);
      check(last.resident <= first.resident * 1.05 + 4, `the controller grew from ${first.resident} to ${last.resident} MB`);
      last.heaps.forEach((heap, at) => check(heap <= first.heaps[at] * 1.1 + 4, `page ${at} grew from ${first.heaps[at]} to ${heap} MB`));
      pages.forEach(clean);
    });
  } finally {
    alone.end();
    await beside.end();
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

// The pictures of the documentation: node tests/page/run.mjs pictures FOLDER. With a second word, all states in three sizes and both
// themes, to be looked at.
export async function pictures(folder = "docs/pictures", all = false) {
  mkdirSync(folder, { recursive: true });
  await inside(MACHINE, async ({ controller, browser, watch }) => {
    const shots = [];
    const sizes = all ? [[1920, 1080], [1280, 800], [768, 1024], [390, 844]] : [[1440, 900]];
    for (const colorScheme of all ? ["dark", "light"] : ["dark"]) {
      for (const [width, height] of sizes) {
        const page = await open(browser, controller.link, { colorScheme, viewport: { width, height } });
        shots.push({ page, name: `${width}-${colorScheme}` });
      }
    }
    const shoot = async (state) => {
      await sleep(800);
      for (const { page, name } of shots) await page.screenshot({ path: join(folder, all ? `${state}-${name}.png` : "operator-page.png") });
    };
    const [{ page }] = shots;
    for (const { page: one } of shots) await one.waitForFunction(() => window.tandem.paintedPoints > 0);
    if (all) await shoot("empty");
    await take(page);
    await page.click("#tab-programs");
    await page.click("text=serpentine.ngc");
    await page.waitForFunction(() => window.tandem.status.program === "serpentine.ngc");
    await page.locator("#feed-override").fill(all ? "5" : "60");
    await page.click("#tab-jog");
    await page.click("#start");
    await until("it is half done", async () => (await watch.ask("status")).progress > (all ? 0.3 : 0.6));
    await shoot("running");
    if (!all) return;
    await page.click("#hold");
    await until("it is held", async () => (await watch.ask("status")).state === "held");
    await shoot("held");
    for (const tab of ["mdi", "programs", "offsets", "tools", "history", "capture", "machine"]) {
      await page.click("#tab-" + tab);
      await sleep(200);
      await page.screenshot({ path: join(folder, `panel-${tab}.png`) });
    }
    await page.click("#views [data-view=XY]");
    await sleep(500);
    await page.screenshot({ path: join(folder, "plane.png") });
    await page.click("#stop");
    await until("it has stopped", async () => (await watch.ask("status")).state === "emergency-stop");
    await shoot("stopped");
  });
}
