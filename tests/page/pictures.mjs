// Pictures of the page as it is.
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { inside, open, sleep, take, until } from "./bench.mjs";

const MACHINE = "examples/machines/mill-3axis-smooth.toml";

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
    await page.locator("#feed-override").fill("30");
    await page.click("#tab-jog");
    await page.click("#start");
    await until("it is half done", async () => (await watch.ask("status")).progress > (all ? 0.3 : 0.6));
    // So slow that it is under way until all pictures are taken.
    if (all) await page.locator("#feed-override").fill("5");
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
