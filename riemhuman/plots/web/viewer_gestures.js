// Mouse, wheel, fingers and keys of a viewer. Part of one script with the other viewer files.
"use strict";

const TURN = Math.PI / 12; // per press of a key or button
const STEP = 0.08; // share of the stage that one press of a key moves the bodies by
const DRAG = { yaw: 120, pitch: 200 }; // pixels for a radian
const DOUBLE_TAP = { milliseconds: 350, pixels: 24 }; // at most between two taps

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
const zoomsByWheel = (viewer, event) =>
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
  const playBySpace = (event) => {
    if (event.key !== " " || event.target.closest("button, select, summary, input:not([type=range])")) return;
    event.preventDefault();
    viewer.toggle();
  };
  viewer.element.addEventListener("keydown", playBySpace);
  // Right after loading, nothing has the focus.
  if (document.querySelectorAll(".viewer").length === 1) {
    document.body.addEventListener("keydown", (event) => {
      if (event.target === document.body && !viewer.find("running").hidden) playBySpace(event);
    });
  }
}

function listenToWheel(viewer) {
  viewer.canvas.addEventListener(
    "wheel",
    (event) => {
      if (!zoomsByWheel(viewer, event)) return;
      event.preventDefault();
      const pixels = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : 1);
      // Browsers report a pinch on a touchpad as a wheel with Ctrl, in smaller steps.
      viewer.magnify(Math.exp(-pixels * (event.ctrlKey ? 0.01 : 0.002)), viewer.place(event));
    },
    { passive: false },
  );
}

// Dragging turns the bodies; with Shift or a button other than the first, it moves them. Two fingers
// move and zoom.
function listenToPointers(viewer) {
  const { canvas } = viewer;
  const pressed = new Map(); // the last event of each pointer that is down
  let isMoving = false;
  let lastTap = null;
  let isTouch = false;

  // The middle of two fingers, and the pixels between them.
  const pinch = () => {
    const [first, second] = [...pressed.values()].map((event) => viewer.place(event));
    return {
      middle: { x: (first.x + second.x) / 2, y: (first.y + second.y) / 2 },
      gap: Math.hypot(first.x - second.x, first.y - second.y) || 1,
    };
  };

  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("pointerdown", (event) => {
    isTouch = event.pointerType === "touch";
    if (pressed.size === 2) return;
    if (event.button === 1) event.preventDefault(); // the middle button would scroll
    pressed.set(event.pointerId, event);
    canvas.setPointerCapture(event.pointerId);
    isMoving = event.shiftKey || event.button > 0;
    viewer.hideHint();
  });
  canvas.addEventListener("pointermove", (event) => {
    const last = pressed.get(event.pointerId);
    if (!last) {
      if (event.pointerType !== "touch" && !event.buttons) viewer.point(viewer.place(event));
      return;
    }
    const before = pressed.size === 2 ? pinch() : null;
    pressed.set(event.pointerId, event);
    const right = event.clientX - last.clientX;
    const below = event.clientY - last.clientY;
    if (before) {
      const after = pinch();
      viewer.move(after.middle.x - before.middle.x, after.middle.y - before.middle.y);
      viewer.magnify(after.gap / before.gap, after.middle);
    } else if (isMoving) {
      viewer.move(right, below);
    } else {
      viewer.turn(right / DRAG.yaw, below / DRAG.pitch);
    }
  });
  canvas.addEventListener("pointerleave", () => viewer.hideHint());
  canvas.addEventListener("pointercancel", (event) => pressed.delete(event.pointerId));
  canvas.addEventListener("pointerup", (event) => {
    const isSingle = pressed.size === 1;
    pressed.delete(event.pointerId);
    if (event.pointerType !== "touch" || !isSingle) return;
    // Fingers cannot hover and, in some browsers, not double-click.
    const tap = { time: event.timeStamp, ...viewer.place(event) };
    const isDouble = lastTap
      && tap.time - lastTap.time < DOUBLE_TAP.milliseconds
      && Math.hypot(tap.x - lastTap.x, tap.y - lastTap.y) < DOUBLE_TAP.pixels;
    if (isDouble) {
      lastTap = null;
      viewer.frame(tap);
    } else {
      lastTap = tap;
      viewer.point(tap);
    }
  });
  canvas.addEventListener("dblclick", (event) => {
    if (!isTouch) viewer.frame(viewer.place(event));
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
