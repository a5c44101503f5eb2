// What the page costs, the machine and the operator: how soon hold is there, programs of many lines, many pages, a slow one. Where the
// clock would judge the computer that tests, processor time is judged; TANDEM_QUIET=1 says that nothing else runs, and the clock is
// judged as well.
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { check, clean, echoes, inside, median, observer, open, renderersOf, serve, take, tasks, until, used } from "./bench.mjs";

const MACHINE = "examples/machines/mill-3axis-smooth.toml";

const BEYOND_ECHO_MS = 20;

// A click on hold is said in the click itself, before anything else, and is with the fine loop as soon as anything else that the same
// page says in the same run, while the machine moves.
export async function hold() {
  await inside(MACHINE, async ({ controller, browser, watch }) => {
    const page = await open(browser, controller.link);
    await take(page);
    const delays = [], beside = [];
    for (let i = 0; i < 7; i++) {
      await page.evaluate(() => window.tandem.link.ask("mdi", { line: `G1 X${200 * (window.side = -(window.side || 1))} F3000` }));
      await until("it moves", async () => (await watch.ask("status")).feed_mm_per_min > 100);
      beside.push(...(await echoes(page, 5)));
      await page.evaluate(() => {
        const ask = window.tandem.link.ask.bind(window.tandem.link);
        window.said = [];
        document.getElementById("hold").addEventListener("click", (event) => {
          [window.clicked, window.said, window.inClick] = [performance.timeOrigin + event.timeStamp, [], true];
          setTimeout(() => { window.inClick = false; });
        }, { once: true, capture: true });
        window.tandem.link.ask = (request, keys) => {
          window.said.push(request);
          if (request === "hold") window.atOnce = window.inClick;
          return ask(request, keys);
        };
      });
      // The controller says that it has come: the page itself may have something to draw before it hears an answer.
      const heard = until("it is heard", async () => ((await watch.ask("status")).state === "mdi" ? null : performance.timeOrigin + performance.now()), undefined, 1);
      await page.click("#hold");
      delays.push((await heard) - (await page.evaluate(() => window.clicked)));
      check(await page.evaluate(() => window.said[0] === "hold"), "something is said between the click and hold");
      check(await page.evaluate(() => window.atOnce), "hold is said after the click is over");
      await until("it is held", async () => (await watch.ask("status")).state === "held");
      await page.evaluate(() => window.tandem.link.ask("abort"));
      await until("it rests", async () => (await watch.ask("status")).state === "ready");
    }
    const [best, echo] = [Math.min(...delays), median(beside)];
    console.log(`hold: ${delays.map((ms) => ms.toFixed(1)).join(", ")} ms from click to controller; echo ${echo.toFixed(1)} ms, at most ${Math.max(...beside).toFixed(1)}`);
    // On a busy computer any of them may wait for the processor.
    check(best <= echo + BEYOND_ECHO_MS, `the fastest of seven took ${best} ms, an echo ${echo} ms`);
    if (process.env.TANDEM_QUIET) check(Math.max(...delays) <= Math.max(...beside) + BEYOND_ECHO_MS, `one took ${Math.max(...delays)} ms`);
    clean(page);
  });
}

const LINES = 300000;
const [MOST_S, MOST_TASK_MS, MOST_HEAP_MB] = [4, 200, 250];
// Largest part of the browser's processor time that one task may have: 7 to 14 % were measured on an idle computer and a busy one, where
// the time itself goes from 104 to 204 ms.
const MOST_OF_A_TASK = 0.25;

// A program of 300 000 lines is drawn while the page stays at hand, by the processor alone: each line is told once and drawn once, and
// turning the view draws it all again. The processor time of everything that the browser and the controller do for it is less than
// the time within which it has to be drawn, and no task has much of it.
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
      const facts = () => page.evaluate(() => ({ answers: window.answers, painted: window.tandem.paintedPoints, points: window.tandem.drawnPoints, longest: Math.max(0, ...window.tasks) }));
      let seconds, drawn, before, after;
      const all = await tasks(browser, async () => {
        await watch.ask("load", { path: "many.ngc" });
        before = await used(browser, controller);
        const start = Date.now();
        await page.waitForFunction((lines) => window.tandem.drawnPoints >= lines, LINES, { timeout: 120000, polling: 50 });
        seconds = (Date.now() - start) / 1000;
        after = await used(browser, controller);
        drawn = await facts();
        const box = await page.locator("#path-over").boundingBox();
        await page.mouse.move(box.x + 100, box.y + 100);
        await page.mouse.down();
        for (let i = 1; i <= 5; i++) await page.mouse.move(box.x + 100 + i * 9, box.y + 100 + i * 4);
        await page.mouse.up();
        await until("it is drawn from another side", async () => (await facts()).painted >= drawn.painted + LINES);
      });
      const [task, heap] = [Math.max(...all), await heapOf(page)];
      const [browsers, controllers] = [after.browser - before.browser, after.controller - before.controller];
      console.log(`${LINES} lines: drawn in ${seconds.toFixed(1)} s, with ${browsers.toFixed(1)} s of the processor in the browser and ${controllers.toFixed(1)} s in the controller; heap ${heap.toFixed(0)} MB; longest task ${task.toFixed(0)} ms of the processor, ${drawn.longest.toFixed(0)} ms in all; ${drawn.answers} answers, ${(drawn.painted / drawn.points).toFixed(2)} times painted`);
      check(heap <= MOST_HEAP_MB, `the heap has ${heap} MB`);
      check(drawn.answers <= 120, `${drawn.answers} answers for ${drawn.points} points`);
      check(drawn.painted <= 2 * drawn.points, `${drawn.painted} points painted for ${drawn.points}`);
      const part = task / 1000 / browsers;
      check(browsers + controllers <= MOST_S && part <= MOST_OF_A_TASK, `${browsers} and ${controllers} s, a task of ${task} ms of the processor`);
      if (process.env.TANDEM_QUIET) check(seconds <= MOST_S && drawn.longest <= MOST_TASK_MS, `${seconds} s, a task of ${drawn.longest} ms`);
      clean(page);
    }, ["--programs", folder]);
  } finally {
    rmSync(folder, { recursive: true, force: true });
  }
}


// What the scripts of the page hold, those of its workers and what lies outside of their heaps among them, MB.
async function heapOf(page) {
  const session = await page.context().newCDPSession(page);
  const { usedSize, backingStorageSize, embedderHeapUsedSize } = await session.send("Runtime.getHeapUsage");
  await session.detach();
  const workers = await Promise.all(page.workers().map((worker) => worker.evaluate(() => {
    const sizes = Object.values(pictures).map(({ values, painter }) => values.byteLength + (painter.image ? painter.image.data.byteLength : 0));
    return sizes.reduce((sum, size) => sum + size, 0);
  })));
  return [usedSize, backingStorageSize || 0, embedderHeapUsedSize || 0, ...workers].reduce((sum, size) => sum + size, 0) / 1e6;
}

// With a graphics unit and without the same lines stand at the same places in the same colours, inside of the picture and where they
// leave it. Here the processor stands in for the unit, which the page itself does not ask for.
export async function painters() {
  await inside(MACHINE, async ({ controller, browser }) => {
    const page = await open(browser, controller.link);
    const [worker] = page.workers();
    const facts = await worker.evaluate(() => {
      const [width, height] = [240, 160], view = { right: [1, 0, 0], up: [0, 0.8, 0.6], centre: [5, 3, 1], scale: 2, width, height, below: 14, ratio: 1 };
      const colours = [[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]];
      const points = [0, 0, 0, -1, 20, 10, 0, 0, 20, 30, 5, 0, -300, 25, 0, 0, -40, -20, 0, -1, 50, -20, 0, 1, 50, -60, 90, 1, 7, 7, 7, -1, 7.1, 7.1, 7, 2, 9, 7, 7, 2];
      const draw = (canvas, painter) => {
        const lines = Object.assign(Object.create(Lines.prototype), { canvas, painter, count: 0, values: new Float32Array(0), drawn: 0, key: "" });
        lines.add(new Float32Array(points.slice(0, 20)));
        lines.draw(view, colours, 3);
        // What comes to a picture that stands is drawn above it.
        lines.add(new Float32Array(points.slice(20)));
        lines.draw(view, colours, 3);
      };
      const unit = new OffscreenCanvas(width, height), plain = new OffscreenCanvas(width, height);
      const gl = unit.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
      draw(unit, new Graphics(gl));
      const context = plain.getContext("2d");
      draw(plain, new Scan(context));
      const upward = new Uint8Array(width * height * 4);
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, upward);
      const data = context.getImageData(0, 0, width, height).data;
      const byUnit = (x, y) => upward.subarray(((height - 1 - y) * width + x) * 4), byHand = (x, y) => data.subarray((y * width + x) * 4);
      const shade = (pixel) => (pixel[3] < 96 ? -1 : [0, 1, 2].find((part) => pixel[part] === Math.max(pixel[0], pixel[1], pixel[2])));
      const near = (of, x, y, wanted) => [-1, 0, 1].some((dx) => [-1, 0, 1].some((dy) => x + dx >= 0 && x + dx < width && y + dy >= 0 && y + dy < height && shade(of(x + dx, y + dy)) === wanted));
      let [alone, covered] = [0, [0, 0]];
      for (let y = 0; y < height; y++) {
        for (let x = 0; x < width; x++) {
          const seen = [shade(byUnit(x, y)), shade(byHand(x, y))];
          covered[0] += byUnit(x, y)[3] / 255;
          covered[1] += byHand(x, y)[3] / 255;
          if ((seen[0] >= 0 && !near(byHand, x, y, seen[0])) || (seen[1] >= 0 && !near(byUnit, x, y, seen[1]))) alone++;
        }
      }
      return { alone, covered };
    });
    console.log(`${facts.covered[0].toFixed(0)} pixels by a graphics unit, ${facts.covered[1].toFixed(0)} without, ${facts.alone} by one alone`);
    check(facts.covered[0] > 500 && Math.abs(facts.covered[0] - facts.covered[1]) < facts.covered[0] / 8 && facts.alone < 20, JSON.stringify(facts));
    clean(page);
  });
}

const TABS = 8;
// Seconds; the long run asks for 600.
const TABS_FOR_S = Number(process.env.TANDEM_TABS_S || 4);

// A page that plots as many signals as can be.
async function withScope(browser, link) {
  const signals = () => localStorage.setItem("signals", JSON.stringify(["x_cmd_mm", "y_cmd_mm", "z_cmd_mm", "x_fb_mm", "y_fb_mm", "z_fb_mm", "feed_mm_s", "sigma"]));
  const page = await open(browser, link, { before: signals });
  await page.selectOption("#scope-what", "signals");
  return page;
}

// Eight pages, each with eight signals of every period: the controller that serves them misses no more periods than one beside it that
// serves nobody, and neither it nor they grow.
export async function tabs() {
  const loop = `G21 G90 F2000\n${"G1 X20 Y10\nG1 X0 Y0\n".repeat(Math.ceil(TABS_FOR_S * 3) + 3000)}M2\n`;
  const beside = await serve(MACHINE);
  const alone = await observer(beside.socket);
  try {
    await inside(MACHINE, async ({ controller, browser, watch }) => {
      const pages = await Promise.all(Array.from({ length: TABS }, () => withScope(browser, controller.link)));
      const clients = [watch, alone];
      for (const client of clients) {
        await client.ask("lease", { how: "take" });
        await client.ask("load", { text: loop, name: "to and fro" });
      }
      const tickNow = async (client) => (await client.ask("status")).tick;
      for (const client of clients) await client.ask("start");
      // All at the same time: one after the other each waits for a page that is busy drawing.
      const look = async () => {
        const heaps = await Promise.all(pages.map(async (page) => {
          const session = await page.context().newCDPSession(page);
          await session.send("HeapProfiler.collectGarbage");
          const { usedSize } = await session.send("Runtime.getHeapUsage");
          await session.detach();
          return usedSize / 1e6;
        }));
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
    const page = await withScope(browser, controller.link);
    await page.waitForFunction(() => window.tandem.scoped);
    await watch.ask("lease", { how: "take" });
    await watch.ask("load", { text: `G21 G90 F1500\n${"G1 X20\nG1 X0\n".repeat(40)}M2\n`, name: "to and fro" });
    await watch.ask("start");
    await until("it runs", async () => (await watch.ask("status")).state === "running");
    const renderers = await renderersOf(browser);
    renderers.forEach((renderer) => process.kill(renderer, "SIGSTOP"));
    const before = (await watch.ask("status")).tick;
    await until("six seconds have passed for the machine", async () => (await watch.ask("status")).tick > before + 6000, 60000);
    renderers.forEach((renderer) => process.kill(renderer, "SIGCONT"));
    await until("it is said that frames are lost", async () => (await page.textContent("#scope-lost")).includes("lost"));
    check((await watch.ask("status")).state === "running", "the machine waited for the page");
    console.log(await page.textContent("#scope-lost"));
    clean(page);
  });
}
