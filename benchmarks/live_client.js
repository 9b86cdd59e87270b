// The JavaScript client of Qualisys as a process; see live_client.py. Arguments: folder of
// node_modules, port, version, number of frames, file of the frames as JSON.
const fs = require('fs');
const [folder, port, version, n, file] = process.argv.slice(2);
const { Api } = require(require.resolve('qualisys-rt', { paths: [folder] }));
const sent = JSON.parse(fs.readFileSync(file));
const EVERY = 5;

let count = 0;
let wrong = 0;
const same = (got, want) =>
  got.length === want.length &&
  got.every((p, i) =>
    want[i] === null ? !Number.isFinite(p.x) : [p.x, p.y, p.z].every((x, j) => Math.fround(x) === want[i][j]));

const api = new Api({ frequency: 'AllFrames' });
api.on('frame', frame => {
  count += 1;
  const want = sent[frame.frame % sent.length];
  const { '3d': markers, '3dNoLabels': points } = frame.components;
  if (frame.frame !== count || !same(markers.markers, want[0]) || !same(points.markers, want[1]))
    wrong += 1;
  if (count % EVERY === 0) console.log(count);
  if (count === Number(n)) {
    console.log(`end ${count} ${wrong}`);
    process.exit(0);
  }
});
(async () => {
  await api.connect(Number(port), '127.0.0.1', 1, Number(version.split('.')[1]));
  await api.streamFrames({ components: ['3D', '3DNoLabels'], frequency: 'AllFrames' });
})();
