// Ours in a browser: the modules of web/ as an exported page has them, without its panel.
import { readContainer } from "/web/renderer/container.js";
import { MIN_ALPHA } from "/web/conventions.js";
import { Renderer } from "/web/renderer/renderer.js";
import { height, job, measure, width } from "/frames.js";

const canvas = document.createElement("canvas");
Object.assign(canvas, { width, height });
document.body.append(canvas);
const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false, preserveDrawingBuffer: true });
const renderer = new Renderer(gl, readContainer(await (await fetch("/scene.bin")).arrayBuffer()));
// "direct": into the 8 bits of the canvas, as the other viewers, and not by a picture of 16 bits.
const direct = new URLSearchParams(location.search).get("peer") === "direct";
renderer.leaveOut({ minAlpha: MIN_ALPHA, direct, resortDegrees: 0, recolorDegrees: 0 });
const turn = () => new Promise((wake) => setTimeout(wake, 0));

let view;
function stand(i) {
  view = { ...job.views[i], near: job.near, viewport: [0, 0, width, height] };
}

stand(0);
renderer.draw([view]);  // shapes, whose means go to the sorter
while (!renderer.settled) {
  await turn();
  if (renderer.takeMeans()) renderer.draw([view]);
}

await measure(canvas, gl, stand, async () => {
  renderer.sortedFor = null;
  renderer.sort(view.worldFromEye, view.near);
  while (!renderer.sorter.settled) await turn();
  renderer.draw([view]);
});
