import * as THREE from "three";
import { SparkRenderer, SplatMesh } from "@sparkjsdev/spark";
import { camera, measureThree, renderer } from "/three_camera.js";

const scene = new THREE.Scene();
const spark = new SparkRenderer({ renderer, autoUpdate: false, sortRadial: false, preBlurAmount: 0.3, blurAmount: 0 });
scene.add(spark);
const splats = new SplatMesh({ url: "/splats.ply" });
await splats.initialized;
scene.add(splats);

// update() sorts in a worker only when it finds the view changed; its flag asks for it each time.
await measureThree(async () => {
  spark.sortDirty = true;
  await spark.update({ scene, camera });
  while (spark.sorting || spark.sortDirty) await new Promise((wake) => setTimeout(wake, 0));
  renderer.render(scene, camera);
});
