import * as pc from "playcanvas";
import { height, job, measure, width } from "/frames.js";

const canvas = document.createElement("canvas");
Object.assign(canvas, { width, height });
document.body.append(canvas);
const device = await pc.createGraphicsDevice(canvas, {
  deviceTypes: [pc.DEVICETYPE_WEBGL2], antialias: false, preserveDrawingBuffer: true,
});
device.maxPixelRatio = 1;
const options = new pc.AppOptions();
Object.assign(options, {
  graphicsDevice: device,
  componentSystems: [pc.CameraComponentSystem, pc.GSplatComponentSystem],
  resourceHandlers: [pc.TextureHandler, pc.ContainerHandler, pc.GSplatHandler],
});
const app = new pc.AppBase(canvas);
app.init(options);
app.setCanvasFillMode(pc.FILLMODE_NONE, width, height);
app.setCanvasResolution(pc.RESOLUTION_FIXED, width, height);
app.autoRender = false;  // only what is asked for below
app.start();

const asset = new pc.Asset("splats", "gsplat", { url: "/splats.ply" });
app.assets.add(asset);
await new Promise((resolve, reject) => {
  asset.ready(resolve);
  asset.on("error", reject);
  app.assets.load(asset);
});
const camera = new pc.Entity("camera"), splats = new pc.Entity("splats");
camera.addComponent("camera", {
  clearColor: new pc.Color(0, 0, 0, 1), fov: job.fov_y_degrees, nearClip: job.near, farClip: job.far,
  toneMapping: pc.TONEMAP_NONE, gammaCorrection: pc.GAMMA_SRGB,
});
// Not unified: with one object whose sorter says when it is done.
splats.addComponent("gsplat", { unified: false, asset });
app.root.addChild(camera);
app.root.addChild(splats);
const { instance } = splats.gsplat, place = new pc.Mat4();

function stand(i) {
  for (let row = 0; row < 4; row++) for (let column = 0; column < 4; column++) place.data[4 * column + row] = job.poses[i][4 * row + column];
  camera.setPosition(place.getTranslation());
  camera.setRotation(new pc.Quat().setFromMat4(place));
}

await measure(canvas, device.gl, stand, async () => {
  const sorted = new Promise((wake) => instance.sorter.once("updated", wake));
  instance.lastCameraPosition.set(NaN, NaN, NaN);  // a fresh order, wherever it stood
  instance.sort(camera);
  await sorted;
  instance.update();  // takes the order
  app.render();
});
