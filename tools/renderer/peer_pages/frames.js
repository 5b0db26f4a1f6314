// What every browser peer is asked to do: draw each pose, wait until its pixels are there, tell.
import * as THREE from "three";

const job = await (await fetch("/job.json")).json();
export const [width, height] = job.size;

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

function stand(pose) {  // pose: world_from_eye, 16 floats, row by row
  camera.matrix.set(...pose);
  camera.matrix.decompose(camera.position, camera.quaternion, camera.scale);
  camera.updateMatrixWorld(true);
}

const tell = (path, body) => fetch(path, { method: "POST", body });

function finish() {  // one pixel read back: the frame is done, not only sent
  const gl = renderer.getContext();
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
}

// draw: async, draws the camera as it stands with a fresh order of the splats.
export async function measure(draw) {
  for (let i = 0; i < job.warm_up; i++) {
    stand(job.poses[i % job.poses.length]);
    await draw();
    finish();
  }
  stand(job.poses[0]);
  await draw();
  await tell("/picture", canvas.toDataURL("image/png").split(",")[1]);
  await tell("/start", "");
  const ms = [];
  for (const pose of job.poses) {
    const start = performance.now();
    stand(pose);
    await draw();
    finish();
    ms.push(performance.now() - start);
  }
  await tell("/end", JSON.stringify(ms));
}

export const refuse = (error) => tell("/failed", String(error && error.stack ? error.stack : error));
window.addEventListener("error", (event) => refuse(event.error || event.message));
window.addEventListener("unhandledrejection", (event) => refuse(event.reason));
