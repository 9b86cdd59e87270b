// The JavaScript client of Qualisys as a process: it prints what it receives as JSON.
// Arguments: folder of node_modules, port, number of frames, version.
const [folder, port, n, version] = process.argv.slice(2);
const { Api } = require(require.resolve('qualisys-rt', { paths: [folder] }));

const api = new Api({ frequency: 'AllFrames' });
const frames = [];
api.on('frame', frame => {
  frames.push(frame);
  if (frames.length === Number(n)) {
    process.stdout.write(JSON.stringify({ settings, state, frames }), () => process.exit(0));
  }
});

let settings, state;
(async () => {
  await api.connect(Number(port), '127.0.0.1', 1, Number(version.split('.')[1]));
  await api.qtmVersion();
  await api.byteOrder();
  state = await api.getState();
  settings = await api.getParameters('3D');
  await api.streamFrames({ components: ['3D', '3DNoLabels'], frequency: 'AllFrames' });
})().catch(error => {
  console.error(error);
  process.exit(1);
});
