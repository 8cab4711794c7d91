// Exports: a picture, the surfaces as shown, and a link to the current view.
// Part of one script with the other viewer files.
"use strict";

const PICTURE_SCALE = 2; // pixels of a picture for one of the screen
const GLB = { magic: 0x46546c67, json: 0x4e4f534a, binary: 0x004e4942 }; // "glTF", "JSON", "BIN"
const GLTF = { float: 5126, integer: 5125, vertices: 34962, indices: 34963 }; // numbers of the standard
const SKIN_ROUGHNESS = 0.62;

function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// A file name made from the title of the view: letters, digits and underscores.
const fileName = (viewer, ending) =>
  `${viewer.element.getAttribute("aria-label").trim().replace(/[^\p{L}\p{N}_.-]+/gu, "_") || "bodies"}.${ending}`;

// A PNG of the bodies as shown, with their labels, on a transparent background.
async function picture(viewer) {
  const { renderer, stage } = viewer;
  const ratio = renderer.getPixelRatio();
  renderer.setPixelRatio(PICTURE_SCALE * Math.max(window.devicePixelRatio || 1, 1));
  renderer.render(viewer.scene, viewer.camera);
  const canvas = document.createElement("canvas");
  canvas.width = renderer.domElement.width;
  canvas.height = renderer.domElement.height;
  const context = canvas.getContext("2d");
  context.drawImage(renderer.domElement, 0, 0);
  renderer.setPixelRatio(ratio);
  viewer.draw();
  const box = stage.getBoundingClientRect();
  context.scale(canvas.width / box.width, canvas.height / box.height);
  writeLabels(viewer, context, box);
  return new Promise((resolve) => { canvas.toBlob(resolve, "image/png"); });
}

// Draw the labels and their colour bars at their places on the stage.
function writeLabels(viewer, context, box) {
  viewer.find("labels").querySelectorAll(".label").forEach((label) => {
    if (label.style.visibility === "hidden") return;
    label.querySelectorAll("span:not(.scale), i").forEach((part) => {
      const place = part.getBoundingClientRect();
      const left = place.left - box.left;
      const top = place.top - box.top;
      if (part.localName === "i") {
        const colors = part.dataset.colors.split(",");
        const stops = part.dataset.stops.split(",");
        const bar = context.createLinearGradient(left, 0, left + place.width, 0);
        colors.forEach((color, k) => bar.addColorStop(Math.min(1, Math.max(0, Number(stops[k]))), color));
        context.fillStyle = bar;
        context.fillRect(left, top, place.width, place.height);
        return;
      }
      const style = getComputedStyle(part);
      context.font = `${style.fontSize} ${style.fontFamily}`;
      context.fillStyle = style.color;
      context.textAlign = "center";
      context.textBaseline = "middle";
      context.fillText(part.textContent, left + place.width / 2, top + place.height / 2, place.width + 2);
    });
  });
}

// All bodies side by side as a binary glTF file, in metres, y up, coloured as shown.
function surfacesFile(viewer) {
  const arrays = [];
  const gltf = {
    asset: { version: "2.0", generator: "riemhuman" },
    scene: 0,
    scenes: [{ nodes: [] }],
    nodes: [], meshes: [], accessors: [], bufferViews: [], buffers: [], materials: [],
  };
  let length = 0;
  // Add an array to the file; return the number of its accessor.
  const add = (array, type, target, range = {}) => {
    gltf.bufferViews.push({ buffer: 0, byteOffset: length, byteLength: array.byteLength, target });
    gltf.accessors.push({
      bufferView: gltf.bufferViews.length - 1,
      componentType: array instanceof Uint32Array ? GLTF.integer : GLTF.float,
      count: array.length / (type === "VEC3" ? 3 : 1),
      type,
      ...range,
    });
    arrays.push(array);
    length += array.byteLength;
    return gltf.accessors.length - 1;
  };
  const indices = add(viewer.faces, "SCALAR", GLTF.indices);
  let shift = 0;
  viewer.bodies().forEach((body, index) => {
    const { color } = body.geometry.attributes;
    const attributes = {
      POSITION: add(body.positions, "VEC3", GLTF.vertices, rangeOf(body.positions)),
      NORMAL: add(body.normals, "VEC3", GLTF.vertices),
    };
    if (color) attributes.COLOR_0 = add(color.array, "VEC3", GLTF.vertices);
    const base = body.mesh.material.color.toArray();
    gltf.materials.push({
      pbrMetallicRoughness: { baseColorFactor: [...base, 1], metallicFactor: 0, roughnessFactor: SKIN_ROUGHNESS },
    });
    gltf.meshes.push({ primitives: [{ attributes, indices, material: index }] });
    if (index) shift += (viewer.bodies()[index - 1].wide + body.wide) / 2;
    gltf.nodes.push({ name: body.label || `body ${index + 1}`, mesh: index, translation: [shift, -body.floor, 0] });
    gltf.scenes[0].nodes.push(index);
  });
  gltf.buffers.push({ byteLength: length });
  return packedFile(gltf, arrays, length);
}

function rangeOf(positions) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  positions.forEach((value, i) => {
    low[i % 3] = Math.min(low[i % 3], value);
    high[i % 3] = Math.max(high[i % 3], value);
  });
  return { min: low, max: high };
}

// A GLB file: a header of 12 bytes, then JSON and the arrays, each behind 8 bytes with its length
// and kind. Lengths are multiples of 4, so JSON is padded with spaces.
function packedFile(gltf, arrays, length) {
  const json = new TextEncoder().encode(JSON.stringify(gltf));
  const padded = new Uint8Array(4 * Math.ceil(json.length / 4)).fill(0x20);
  padded.set(json);
  const version = 2;
  return new Blob([
    Uint32Array.of(GLB.magic, version, 12 + 8 + padded.length + 8 + length),
    Uint32Array.of(padded.length, GLB.json), padded,
    Uint32Array.of(length, GLB.binary), ...arrays,
  ], { type: "model/gltf-binary" });
}

// The camera, the choice and the time as the fragment of a URL.
function viewOf(viewer) {
  const numbers = [viewer.yaw, viewer.pitch, viewer.zoom, viewer.panX, viewer.panY, viewer.time];
  const pivot = viewer.bodies()[0].pivot;
  const texts = [...numbers.map((number) => String(Number(number.toFixed(4)))), viewer.chosen, pivot ?? ""];
  return `#${viewer.element.id}=${texts.join(",")}`;
}

// Show the view that the URL describes, if it is one of this viewer.
async function restore(viewer) {
  const name = `#${viewer.element.id}=`;
  const { hash } = window.location;
  if (!hash.startsWith(name)) return;
  const texts = hash.slice(name.length).split(",");
  const numbers = texts.map(Number);
  if (texts.length !== 8 || !numbers.every(Number.isFinite)) return;
  const [yaw, pitch, zoom, panX, panY, time, choice, pivot] = numbers;
  if (viewer.data.choices[choice] && choice !== viewer.chosen) {
    viewer.element.querySelectorAll('input[type="radio"][value]').forEach((radio) => {
      radio.checked = Number(radio.value) === choice;
    });
    await viewer.choose(choice);
  }
  const nVertices = viewer.bodies()[0].positions.length / 3;
  if (texts[7] !== "" && Number.isInteger(pivot) && pivot >= 0 && pivot < nVertices) {
    viewer.bodies().forEach((body) => body.turnAbout(pivot));
  }
  viewer.yaw = yaw;
  viewer.pitch = Math.min(PITCH_LIMIT, Math.max(-PITCH_LIMIT, pitch));
  viewer.zoom = Math.min(ZOOM_LIMITS[1], Math.max(ZOOM_LIMITS[0], zoom));
  viewer.panX = panX;
  viewer.panY = panY;
  viewer.seek(time);
}

// Put the link in the address bar and, if the browser allows it, on the clipboard.
async function link(viewer, button) {
  window.history.replaceState(null, "", viewOf(viewer));
  const isCopied = await copy(window.location.href);
  const name = button.textContent;
  button.textContent = isCopied ? "Link copied" : "Link in the address bar";
  setTimeout(() => { button.textContent = name; }, 2000);
}

// Copy a text to the clipboard; return whether the browser allowed it.
async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    return false;
  }
}

function listenToExports(viewer) {
  const part = viewer.find("exports");
  if (!part) return; // pages stored by earlier releases
  const on = (action, listener) => {
    const button = part.querySelector(`[data-export="${action}"]`);
    button.addEventListener("click", () => listener(button));
    return button;
  };
  on("png", async () => download(await picture(viewer), fileName(viewer, "png")));
  on("glb", () => download(surfacesFile(viewer), fileName(viewer, "glb")));
  const linkButton = on("link", (button) => link(viewer, button));
  // Notebooks show the page in a frame that has no address of its own.
  const scheme = window.location.protocol.replace(":", "");
  linkButton.hidden = !["http", "https", "file"].includes(scheme);
}
