import * as GaussianSplats3D from "@mkkellogg/gaussian-splats-3d";
import { camera, measureThree, renderer } from "/three_camera.js";

const viewer = new GaussianSplats3D.Viewer({
  selfDrivenMode: false, renderer, camera, useBuiltInControls: false, gpuAcceleratedSort: false,
  sharedMemoryForWorkers: false, sphericalHarmonicsDegree: 2, ignoreDevicePixelRatio: true,
  sceneRevealMode: GaussianSplats3D.SceneRevealMode.Instant, antialiased: false,
});
await viewer.addSplatScene("/splats.ply", { showLoadingUI: false, splatAlphaRemovalThreshold: 1 });

await measureThree(async () => {
  viewer.update();  // matrices and uniforms; may begin a sort of its own
  if (viewer.sortPromise) await viewer.sortPromise;
  await viewer.runSplatSort(true, true);
  if (viewer.sortPromise) await viewer.sortPromise;
  viewer.render();
});
