// Photographs CNCjs while it drives a simulated mill: node tests/senders/picture.mjs PICTURE [PROGRAM]. Needs target/release/tandem,
// CNCjs (tests/senders/install cncjs), Chromium, and playwright-core in target/npm.
import { spawn } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync, existsSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { basename, join, resolve } from 'node:path';

const [picture, program = 'examples/programs/spiral.ngc'] = process.argv.slice(2);
const senders = resolve('target/senders/node_modules');
const of = createRequire(join(senders, 'x.js'));
const { chromium } = createRequire(resolve('target/npm/node_modules/x.js'))('playwright-core');
const folder = mkdtempSync(join(tmpdir(), 'tandem-picture-'));
const terminal = join(folder, 'ttyTandem');
const secret = 'of this picture alone';
const port = 20000 + (process.pid % 20000);
const children = [];

function begin(command, args, env = {}) {
  const child = spawn(command, args, { env: { ...process.env, ...env }, stdio: 'ignore' });
  children.push(child);
}

async function until(look) {
  for (let looks = 0; looks < 600; looks += 1) {
    const found = await look();
    if (found) return found;
    await new Promise((on) => setTimeout(on, 100));
  }
  throw new Error(`this did not come: ${look}`);
}

async function photograph() {
  begin(process.env.TANDEM || 'target/release/tandem', ['serve', '--machine', 'examples/machines/mill-3axis.toml', '--no-state',
    '--listen', join(folder, 'socket'), '--grbl-pty', terminal,
    '--set', 'loops.max_missed_periods=100000', '--set', 'loops.max_missed_share=1']);
  await until(() => existsSync(terminal));
  const rc = join(folder, 'cncrc');
  const ports = [{ path: terminal, manufacturer: 'Tandem' }];
  writeFileSync(rc, JSON.stringify({ secret, ports, state: { checkForUpdates: false } }));
  // CNCjs asks udev for ports, and lists none at all where there is no udev, as in a container.
  writeFileSync(join(folder, 'udevadm'), '#!/bin/sh\n', { mode: 0o755 });
  const PATH = `${process.env.PATH}:${folder}`;
  begin(process.execPath, [join(senders, 'cncjs/bin/cncjs'), '--host', '127.0.0.1', '--port', String(port), '--config', rc], { HOME: folder, PATH });
  await until(() => fetch(`http://127.0.0.1:${port}/`).then((answer) => answer.ok, () => false));

  const token = of('jsonwebtoken').sign({ id: '', name: '' }, secret);
  const socket = of('socket.io-client').connect(`http://127.0.0.1:${port}`, { query: `token=${token}` });
  let status = {};
  socket.on('controller:state', (type, state) => { status = state.status || status; });
  await new Promise((on) => socket.on('startup', on));
  socket.emit('open', terminal, { controllerType: 'Grbl', baudrate: 115200, rtscts: false }, () => {});
  await until(() => status.activeState === 'Idle');

  const browser = await chromium.launch({
    executablePath: process.env.CHROMIUM || '/usr/bin/chromium',
    args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
  });
  const page = await browser.newPage({ viewport: { width: 1400, height: 900 } });
  await page.goto(`http://127.0.0.1:${port}/`);
  await page.getByText('Choose a port').click();
  await page.getByText(terminal).first().click();
  await page.getByRole('button', { name: 'Open' }).click();
  await page.getByRole('button', { name: 'Close' }).waitFor();
  const text = readFileSync(program, 'utf8');
  socket.emit('command', terminal, 'gcode:load', basename(program), text, {}, () => socket.emit('command', terminal, 'gcode:start'));
  await until(() => status.activeState === 'Run' && Math.abs(Number(status.mpos.x)) > 1);
  await new Promise((on) => setTimeout(on, 2500));
  await page.screenshot({ path: picture });
  await browser.close();
  socket.close();
}

try {
  await photograph();
} finally {
  for (const child of children) child.kill();
  rmSync(folder, { recursive: true, force: true });
}
process.exit(0);
