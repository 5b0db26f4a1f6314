// What every browser peer is asked to do: draw each pose, wait until its pixels are there, tell.
export const job = await (await fetch("/job.json")).json();
export const [width, height] = job.size;

const tell = (path, body) => fetch(path, { method: "POST", body });

function finish(gl) {  // one pixel read back: the frame is done, not only sent
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
}

// stand(i): takes pose i.  draw: async, draws from there with a fresh order of the splats.
export async function measure(canvas, gl, stand, draw) {
  for (let i = 0; i < job.warm_up; i++) {
    stand(i % job.poses.length);
    await draw();
    finish(gl);
  }
  stand(0);
  await draw();
  await tell("/picture", canvas.toDataURL("image/png").split(",")[1]);
  await tell("/start", "");
  const ms = [];
  // The first one last: some sort only when the view has changed.
  for (let i = 1; i <= job.poses.length; i++) {
    const start = performance.now();
    stand(i % job.poses.length);
    await draw();
    finish(gl);
    ms.push(performance.now() - start);
  }
  await tell("/end", JSON.stringify(ms));
}

export const refuse = (error) => tell("/failed", String(error && error.stack ? error.stack : error));
window.addEventListener("error", (event) => refuse(event.error || event.message));
window.addEventListener("unhandledrejection", (event) => refuse(event.reason));
