// A jog ends by itself, whatever becomes of the page whose key is held: what the machine travels behind the event is bounded by the
// keep-alive, one period, and the way to rest. Where nothing ended it, it would go on to the end of the travel.
import { check, inside, open, passes, renderersOf, take, until } from "./bench.mjs";

const MACHINE = "examples/machines/mill-3axis.toml";
const FEED_MM_PER_MIN = 3000;
const KEEP_ALIVE_S = 0.2, PERIOD_S = 0.001, ACCELERATION = 1000;
const TRAVEL_MM = 250;
// The computer that tests has little time: what the page has said may be on its way for as long.
const MAX_LAG_S = 0.25;

const EVENTS = {
  released: async ({ page }) => page.mouse.up(),
  // Something else takes the events that say so: what the browser tells of the lost capture remains.
  "pointer-up-lost": async ({ page }) => {
    await page.evaluate(() => window.tandem.lostUp = true);
    await page.mouse.up();
  },
  hidden: async ({ page }) => page.evaluate(() => {
    Object.defineProperty(document, "hidden", { get: () => true });
    Object.defineProperty(document, "visibilityState", { get: () => "hidden" });
    document.dispatchEvent(new Event("visibilitychange"));
  }),
  busy: async ({ page }) => {
    await page.evaluate(() => { setTimeout(() => { const start = performance.now(); while (performance.now() - start < 1500); }); });
  },
  stopped: async ({ renderers }) => renderers.forEach((renderer) => process.kill(renderer, "SIGSTOP")),
  killed: async ({ renderers }) => renderers.forEach((renderer) => process.kill(renderer, "SIGKILL")),
};

export function jog(name) {
  return inside(MACHINE, async ({ controller, browser, watch }) => {
    let renderers = [];
    const wake = () => {
      for (const renderer of name === "stopped" ? renderers : []) {
        try { process.kill(renderer, "SIGCONT"); } catch { /* it is gone */ }
      }
    };
    try {
      const page = await open(browser, controller.link);
      if (name === "pointer-up-lost") {
        await page.evaluate(() => {
          for (const event of ["pointerup", "mouseup"]) {
            window.addEventListener(event, (told) => { if (window.tandem.lostUp) told.stopImmediatePropagation(); }, true);
          }
        });
      }
      await take(page);
      await page.click("#tab-jog");
      await page.selectOption("select[aria-label='Jog feed']", String(FEED_MM_PER_MIN));
      await page.locator("[data-jog='x+']").hover();
      await page.mouse.down();
      const place = async () => (await watch.ask("status")).position.x_mm;
      await until("the machine moves", async () => (await place()) > 10);
      renderers = await renderersOf(browser);
      const start = Date.now();
      const before = await place();
      await EVENTS[name]({ page, renderers });
      const lag_s = (Date.now() - start) / 1000;
      const rest = await until("the machine rests", async () => {
        const status = await watch.ask("status");
        return status.state === "ready" && status.job === null ? status : null;
      });
      const end = rest.position.x_mm;
      const speed = FEED_MM_PER_MIN / 60;
      const most = speed * (KEEP_ALIVE_S + PERIOD_S + lag_s + MAX_LAG_S) + speed ** 2 / (2 * ACCELERATION);
      console.log(`${name}: ${(end - before).toFixed(3)} mm behind the event, ${most.toFixed(1)} allowed, asked within ${(lag_s * 1000).toFixed(0)} ms`);
      check(end - before <= most && end < TRAVEL_MM - 1, `${name}: it went on for ${end - before} mm to ${end}`);
      // What was on its way, and what a page says that comes back to life, begins nothing.
      wake();
      if (name !== "killed") await page.evaluate(() => new Promise((awake) => setTimeout(awake)));
      await passes(watch, 3 * KEEP_ALIVE_S / PERIOD_S);
      check((await place()) === end, `${name}: it began again`);
      check(controller.child.exitCode === null, "the controller has ended");
    } finally {
      wake();
    }
  }, []);
}
