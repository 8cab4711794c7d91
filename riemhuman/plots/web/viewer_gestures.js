// Mouse, wheel, fingers and keys of a viewer. Part of one script with the other viewer files.
"use strict";

const TURN = Math.PI / 12; // one press of a key or button
const STEP = 0.08; // of the stage, one press of a key
const TAP = { milliseconds: 350, pixels: 24 };

const KEYS = {
  ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down",
  "+": "closer", "=": "closer", "-": "farther", Home: "reset", Enter: "frame",
};

const actionsOf = (viewer) => ({
  left: () => viewer.turn(-TURN, 0),
  right: () => viewer.turn(TURN, 0),
  up: () => viewer.turn(0, TURN),
  down: () => viewer.turn(0, -TURN),
  closer: () => viewer.magnify(1.2),
  farther: () => viewer.magnify(1 / 1.2),
  reset: () => viewer.reset(),
  frame: () => viewer.frame(viewer.middle()),
  sample: () => viewer.sliders.set(normalNumber),
  middle: () => viewer.sliders.set(() => 0),
});

// The wheel scrolls the page until the view has the focus, unless there is nothing to scroll.
const takesWheel = (viewer, event) =>
  event.ctrlKey
  || document.activeElement === viewer.canvas
  || (window === window.top && document.documentElement.scrollHeight <= window.innerHeight);

function listenToKeys(viewer, actions) {
  viewer.canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const action = KEYS[event.key];
    if (!action) return;
    event.preventDefault();
    const moves = {
      ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1],
    }[event.key];
    if (event.shiftKey && moves) {
      viewer.move(STEP * moves[0] * viewer.stage.clientWidth, STEP * moves[1] * viewer.stage.clientHeight);
    } else {
      actions[action]();
    }
  });
  viewer.element.addEventListener("keydown", (event) => {
    if (event.key !== " " || event.target.closest("button, select, summary, input:not([type=range])")) return;
    event.preventDefault();
    viewer.toggle();
  });
}

function listenToWheel(viewer) {
  viewer.canvas.addEventListener(
    "wheel",
    (event) => {
      if (!takesWheel(viewer, event)) return;
      event.preventDefault();
      const pixels = event.deltaY * (event.deltaMode === 1 ? 16 : 1);
      viewer.magnify(Math.exp(-pixels * (event.ctrlKey ? 0.01 : 0.002)), viewer.place(event));
    },
    { passive: false },
  );
}

// One pointer turns, or moves with Shift or another button than the first; two pinch and move.
function listenToPointers(viewer) {
  const { canvas } = viewer;
  const down = new Map();
  let moves = false;
  let tap = null;
  let touched = false;

  const pair = () => {
    const [one, other] = [...down.values()].map((event) => viewer.place(event));
    return {
      middle: { x: (one.x + other.x) / 2, y: (one.y + other.y) / 2 },
      gap: Math.hypot(one.x - other.x, one.y - other.y) || 1,
    };
  };

  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("pointerdown", (event) => {
    touched = event.pointerType === "touch";
    if (down.size === 2) return;
    if (event.button === 1) event.preventDefault();
    down.set(event.pointerId, event);
    canvas.setPointerCapture(event.pointerId);
    moves = event.shiftKey || event.button > 0;
    viewer.hush();
  });
  canvas.addEventListener("pointermove", (event) => {
    const last = down.get(event.pointerId);
    if (!last) {
      if (event.pointerType !== "touch" && !event.buttons) viewer.point(viewer.place(event));
      return;
    }
    const before = down.size === 2 && pair();
    down.set(event.pointerId, event);
    const [right, below] = [event.clientX - last.clientX, event.clientY - last.clientY];
    if (before) {
      const after = pair();
      viewer.move(after.middle.x - before.middle.x, after.middle.y - before.middle.y);
      viewer.magnify(after.gap / before.gap, after.middle);
    } else if (moves) {
      viewer.move(right, below);
    } else {
      viewer.turn(right / 120, below / 200);
    }
  });
  canvas.addEventListener("pointerleave", () => viewer.hush());
  canvas.addEventListener("pointercancel", (event) => down.delete(event.pointerId));
  canvas.addEventListener("pointerup", (event) => {
    const alone = down.size === 1;
    down.delete(event.pointerId);
    if (event.pointerType !== "touch" || !alone) return;
    // Touch has no hover and, in some browsers, no double click.
    const now = { at: event.timeStamp, ...viewer.place(event) };
    const near = tap && Math.hypot(now.x - tap.x, now.y - tap.y) < TAP.pixels;
    if (near && now.at - tap.at < TAP.milliseconds) {
      tap = null;
      viewer.frame(now);
    } else {
      tap = now;
      viewer.point(now);
    }
  });
  canvas.addEventListener("dblclick", (event) => {
    if (!touched) viewer.frame(viewer.place(event));
  });
}

function listenToControls(viewer, actions) {
  const slider = viewer.find("time");
  slider.addEventListener("input", () => {
    viewer.pause();
    viewer.seek(Number(slider.value) / Number(slider.max));
  });
  viewer.find("play").addEventListener("click", () => viewer.toggle());
  viewer.element.querySelectorAll('input[type="radio"]').forEach((radio) => {
    radio.addEventListener("change", () => viewer.choose(Number(radio.value)));
  });
  viewer.element.querySelectorAll("button[data-action]").forEach((button) => {
    button.addEventListener("click", actions[button.dataset.action]);
  });
}

function listen(viewer) {
  const actions = actionsOf(viewer);
  listenToKeys(viewer, actions);
  listenToWheel(viewer);
  listenToPointers(viewer);
  listenToControls(viewer, actions);
}
