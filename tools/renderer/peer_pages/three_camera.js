// The canvas and camera of the peers that draw with three.js.
import * as THREE from "three";
import { height, job, measure, width } from "/frames.js";

const canvas = document.createElement("canvas");
document.body.append(canvas);
export const renderer = new THREE.WebGLRenderer({
  canvas, antialias: false, preserveDrawingBuffer: true, powerPreference: "high-performance",
});
renderer.setPixelRatio(1);
renderer.setSize(width, height);
renderer.setClearColor(0x000000, 1);

export const camera = new THREE.PerspectiveCamera(job.fov_y_degrees, width / height, job.near, job.far);
camera.matrixAutoUpdate = false;

function stand(i) {
  camera.matrix.set(...job.poses[i]);  // world_from_eye, 16 floats, row by row
  camera.matrix.decompose(camera.position, camera.quaternion, camera.scale);
  camera.updateMatrixWorld(true);
}

export const measureThree = (draw) => measure(canvas, renderer.getContext(), stand, draw);
