// Mouse, fingers and keys that move the camera.

/** Moves `camera`; calls `moved()` after each change, `clicked(x, y)` and `doubleClicked(x, y)`. `under(x, y)` is the point there. */
export function controlCamera(canvas, camera, { moved, clicked, doubleClicked, under }) {
  const fingers = new Map();
  let start = null;
  let anchor = { time: -Infinity };

  const at = ({ clientX, clientY }) => [clientX, clientY];
  const middle = () => {
    const all = [...fingers.values()];
    const mean = [0, 1].map((a) => all.reduce((sum, p) => sum + p[a], 0) / all.length);
    return { mean, spread: all.length > 1 ? Math.hypot(all[0][0] - all[1][0], all[0][1] - all[1][1]) : 0 };
  };
  /** The point under the pointer, looked up once per burst of wheel steps. */
  const anchored = ([x, y]) => {
    const now = performance.now();
    const isOld = now - anchor.time > 400 || Math.hypot(x - anchor.x, y - anchor.y) > 6;
    anchor = { x, y, time: now, point: isOld ? (under(x, y) ?? camera.onTargetPlane(x, y)) : anchor.point };
    return anchor.point;
  };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, at(event));
    const isPan = event.button === 1 || event.button === 2 || event.shiftKey;
    start = fingers.size === 1 ? { place: at(event), isPan, isClick: event.button === 0 && !event.shiftKey } : { isPan: true };
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    const before = middle();
    fingers.set(event.pointerId, at(event));
    const after = middle();
    const [dx, dy] = [after.mean[0] - before.mean[0], after.mean[1] - before.mean[1]];
    if (start?.place && Math.hypot(...at(event).map((c, a) => c - start.place[a])) > 4) start.isClick = false;
    if (start?.isClick) return;
    if (start?.isPan || fingers.size > 1) camera.pan(dx, dy);
    else camera.orbit(dx, dy);
    if (before.spread > 0 && after.spread > 0) camera.zoom(before.spread / after.spread, anchored(after.mean));
    moved();
  });
  const up = (event) => {
    if (!fingers.delete(event.pointerId)) return;
    if (event.type === "pointerup" && fingers.size === 0 && start?.isClick) clicked(...at(event));
    start = fingers.size > 0 ? { isPan: fingers.size > 1 } : null;
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("dblclick", (event) => doubleClicked(...at(event)));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 30 : 1;
    const factor = Math.exp(Math.min(Math.max(event.deltaY * lines, -240), 240) * 0.0016);
    camera.zoom(factor, anchored(at(event)));
    moved();
  }, { passive: false });

  const steps = { ArrowLeft: [-24, 0], ArrowRight: [24, 0], ArrowUp: [0, -24], ArrowDown: [0, 24] };
  const zooms = { "+": 0.8, "=": 0.8, "-": 1.25 };
  const views = { 1: [-Math.PI / 2, Math.PI / 2], 2: [-Math.PI / 2, 0], 3: [0, 0] };
  /** True when the key moved the camera. */
  return (event) => {
    if (steps[event.key]) {
      if (event.shiftKey) camera.pan(...steps[event.key].map((c) => -c));
      else camera.orbit(...steps[event.key]);
    } else if (zooms[event.key]) camera.zoom(zooms[event.key], camera.target);
    else if (views[event.key]) [camera.yaw, camera.pitch] = views[event.key];
    else return false;
    moved();
    return true;
  };
}
