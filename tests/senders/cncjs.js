// Streams a program with the server of CNCjs, as it comes from npm: node cncjs.js FOLDER TERMINAL PROGRAM [SCREENSHOT].
const { spawn } = require('child_process');
const fs = require('fs');
const os = require('os');
const path = require('path');

const [folder, terminal, program] = process.argv.slice(2);
const of = (name) => require(path.join(path.resolve(folder), 'node_modules', name));
const io = of('socket.io-client');
const jwt = of('jsonwebtoken');

const home = fs.mkdtempSync(path.join(os.tmpdir(), 'cncjs-'));
const secret = 'of this test alone';
const rc = path.join(home, 'cncrc');
fs.writeFileSync(rc, JSON.stringify({ secret, state: { checkForUpdates: false } }));
const port = 20000 + (process.pid % 20000);
const command = path.join(path.resolve(folder), 'node_modules/cncjs/bin/cncjs');
const server = spawn(process.execPath, [command, '--host', '127.0.0.1', '--port', String(port), '--config', rc], {
  env: { ...process.env, HOME: home },
  stdio: ['ignore', 'pipe', 'inherit'],
});

function end(status, words) {
  if (words) console.log(words);
  server.kill();
  fs.rmSync(home, { recursive: true, force: true });
  process.exit(status);
}
setTimeout(() => end(1, 'it took too long'), 300000);

let begun = false;
server.stdout.on('data', () => {
  if (!begun) {
    begun = true;
    setTimeout(drive, 500);
  }
});

function drive() {
  const token = jwt.sign({ id: '', name: '' }, secret);
  const socket = io.connect(`http://127.0.0.1:${port}`, { query: `token=${token}` });
  let connected = 0;
  let started = false;
  let running = false;
  let place = '';
  const sees = (state) => {
    const status = (state && state.status) || {};
    place = JSON.stringify(status.mpos);
    if (!started && status.activeState === 'Idle') {
      started = true;
      console.log(`connected after ${((Date.now() - connected) / 1000).toFixed(1)} s`);
      const text = fs.readFileSync(program, 'utf8');
      socket.emit('command', terminal, 'gcode:load', 'program.nc', text, {}, (why) => {
        if (why) end(1, `it cannot be loaded: ${why}`);
        socket.emit('command', terminal, 'gcode:start');
      });
    }
    if (started && status.activeState === 'Run') running = true;
    if (status.activeState === 'Alarm') end(1, `an alarm: ${JSON.stringify(state)}`);
    if (running && done && status.activeState === 'Idle') end(0, `stands at ${place}`);
  };
  let done = false;
  socket.on('sender:status', (status) => {
    if (status.total > 0 && status.received >= status.total) done = true;
  });
  socket.on('controller:state', (type, state) => sees(state));
  socket.on('serialport:read', (line) => {
    if (line.startsWith('error:')) end(1, line);
  });
  socket.on('error', (why) => end(1, `refused: ${JSON.stringify(why)}`));
  socket.on('startup', () => {
    connected = Date.now();
    socket.emit('open', terminal, { controllerType: 'Grbl', baudrate: 115200, rtscts: false }, (why) => {
      if (why) end(1, `it cannot be opened: ${why}`);
    });
  });
}
