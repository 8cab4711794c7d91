// Frames of a body: the coordinates of each, or a surface at rest and the motion of its bones.
// Both have nFrames, an extent, and pose(place, positions), which writes the surface at a frame or
// between two, about the centre. Part of one script with the other viewer files.
"use strict";

const QUATERNION_UNIT = 32767; // of the 16 bits that store a component from -1 to 1

const framesOf = (data, nVertices) =>
  data.bones ? BoneFrames.from(data, nVertices) : CoordinateFrames.from(data, nVertices);

// The last frame before a position, and the weight of the next frame.
function between(place, nFrames) {
  const first = Math.min(Math.floor(place), Math.max(nFrames - 2, 0));
  return { first, next: Math.min(first + 1, nFrames - 1), share: place - first };
}

class CoordinateFrames {
  static async from(data, nVertices) {
    const width = data.n_frames > 1 ? 3 * nVertices : 3;
    return new CoordinateFrames(data, nVertices, await unpack(data.frames, Uint16Array, width));
  }

  constructor(data, nVertices, packed) {
    this.nFrames = data.n_frames;
    this.size = 3 * nVertices;
    this.low = data.low;
    this.step = data.step;
    this.packed = packed;
  }

  // The upright cylinder around all frames; each coordinate may also move by up to reach.
  measure(reach) {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    const coordinate = (i) => this.low[i % 3] + this.step[i % 3] * this.packed[i];
    for (let i = 0; i < this.packed.length; i += 1) {
      const axis = i % 3;
      const value = coordinate(i);
      const more = reach[i % this.size];
      if (value - more < low[axis]) low[axis] = value - more;
      if (value + more > high[axis]) high[axis] = value + more;
    }
    this.centre = low.map((value, axis) => (value + high[axis]) / 2);
    let square = 0;
    for (let i = 0; i < this.packed.length; i += 3) {
      const x = coordinate(i) - this.centre[0];
      const z = coordinate(i + 2) - this.centre[2];
      square = Math.max(square, x * x + z * z);
    }
    return { centre: this.centre, height: high[1] - low[1], radius: Math.sqrt(square) };
  }

  pose(place, positions) {
    const { first, next, share } = between(place, this.nFrames);
    const [start, end] = [first * this.size, next * this.size];
    for (let i = 0; i < this.size; i += 1) {
      const axis = i % 3;
      const value = this.packed[start + i] * (1 - share) + this.packed[end + i] * share;
      positions[i] = this.low[axis] + this.step[axis] * value - this.centre[axis];
    }
  }
}

// Linear blend skinning: each vertex moves with the weighted mean of the motions of its joints.
class BoneFrames {
  static async from(data, nVertices) {
    const { bones } = data;
    const width = bones.joints.length;
    const [rest, starts, influences, weights, rotations, places, correctives] = await Promise.all([
      unpack(bones.rest, Uint16Array, 3),
      unpack(bones.starts, Uint32Array, 1),
      inflate(bones.influences),
      inflate(bones.weights),
      unpack(bones.rotations, Uint16Array, 4 * width),
      unpack(bones.places, Uint32Array, 3),
      bones.correctives && Correctives.from(bones.correctives),
    ]);
    return new BoneFrames(data, nVertices, {
      rest,
      starts,
      influences: new Uint16Array(influences.buffer),
      weights: new Uint16Array(weights.buffer),
      rotations: new Int16Array(rotations.buffer),
      places: new Int32Array(places.buffer),
      correctives,
    });
  }

  constructor(data, nVertices, { rest, starts, influences, weights, rotations, places, correctives }) {
    const { bones } = data;
    this.nFrames = data.n_frames;
    this.nVertices = nVertices;
    this.bones = bones;
    this.rest = Float32Array.from(rest, (value, i) => bones.low[i % 3] + bones.step * value);
    this.starts = starts;
    this.influences = influences;
    this.shares = new Float32Array(weights.length);
    for (let v = 0; v < nVertices; v += 1) {
      let sum = 0;
      for (let k = starts[v]; k < starts[v + 1]; k += 1) sum += weights[k];
      for (let k = starts[v]; k < starts[v + 1]; k += 1) this.shares[k] = weights[k] / sum;
    }
    this.rotations = rotations;
    this.places = places;
    this.correctives = correctives;
    this.surface = correctives ? new Float32Array(this.rest) : this.rest;
    this.motions = new Float64Array(12 * bones.joints.length);
    this.joints = bones.joints.map(() => [0, 0, 0]); // in space
  }

  measure() {
    const { low, high, radius } = this.bones.extent;
    this.centre = low.map((value, axis) => (value + high[axis]) / 2);
    return { centre: this.centre, height: high[1] - low[1], radius };
  }

  pose(place, positions) {
    const when = between(place, this.nFrames);
    this.moveBones(when);
    if (this.correctives) this.correctives.add(when, this.rest, this.surface);
    const { surface, starts, influences, shares, motions } = this;
    for (let v = 0; v < this.nVertices; v += 1) {
      const x = surface[3 * v];
      const y = surface[3 * v + 1];
      const z = surface[3 * v + 2];
      let right = 0;
      let up = 0;
      let forward = 0;
      for (let k = starts[v]; k < starts[v + 1]; k += 1) {
        const m = 12 * influences[k];
        const share = shares[k];
        right += share * (motions[m] * x + motions[m + 1] * y + motions[m + 2] * z + motions[m + 3]);
        up += share * (motions[m + 4] * x + motions[m + 5] * y + motions[m + 6] * z + motions[m + 7]);
        forward += share * (motions[m + 8] * x + motions[m + 9] * y + motions[m + 10] * z + motions[m + 11]);
      }
      positions[3 * v] = right;
      positions[3 * v + 1] = up;
      positions[3 * v + 2] = forward;
    }
  }

  // Rotation and translation of each joint in space, row by row, about the centre of the view.
  moveBones({ first, next, share }) {
    const { joints, parents, order, step } = this.bones;
    const n = joints.length;
    const shift = [0, 1, 2].map((axis) => this.bones.first[axis] - this.centre[axis]
      + step * (this.places[3 * first + axis] * (1 - share) + this.places[3 * next + axis] * share));
    order.forEach((joint) => {
      const turned = this.turn(4 * (first * n + joint), 4 * (next * n + joint), share);
      const parent = parents[joint];
      const m = 12 * joint;
      const place = this.joints[joint];
      for (let row = 0; row < 3; row += 1) {
        if (parent < 0) {
          place[row] = joints[joint][row] + shift[row];
          for (let column = 0; column < 3; column += 1) {
            this.motions[m + 4 * row + column] = turned[3 * row + column];
          }
          continue;
        }
        const p = 12 * parent + 4 * row;
        place[row] = this.joints[parent][row];
        for (let k = 0; k < 3; k += 1) {
          place[row] += this.motions[p + k] * (joints[joint][k] - joints[parent][k]);
        }
        for (let column = 0; column < 3; column += 1) {
          let sum = 0;
          for (let k = 0; k < 3; k += 1) sum += this.motions[p + k] * turned[3 * k + column];
          this.motions[m + 4 * row + column] = sum;
        }
      }
      for (let row = 0; row < 3; row += 1) {
        let moved = place[row];
        for (let k = 0; k < 3; k += 1) moved -= this.motions[m + 4 * row + k] * joints[joint][k];
        this.motions[m + 4 * row + 3] = moved;
      }
    });
  }

  // The matrix of a rotation between two frames, whose quaternions have similar signs.
  turn(before, after, share) {
    const q = [0, 1, 2, 3].map((k) =>
      (this.rotations[before + k] * (1 - share) + this.rotations[after + k] * share) / QUATERNION_UNIT);
    const length = Math.hypot(...q) || 1;
    const [x, y, z, w] = q.map((value) => value / length);
    return [
      1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
      2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
      2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y),
    ];
  }
}

// Changes of the surface at rest with the pose: a few directions, and their weights in each frame.
class Correctives {
  static async from({ rank, step, directions, amounts }) {
    const correctives = new Correctives();
    correctives.rank = rank;
    const numbers = rank ? await unpack(directions, Uint16Array, 3) : new Uint16Array();
    correctives.directions = Float32Array.from(new Int16Array(numbers.buffer), (value) => step * value);
    correctives.amounts = new Float32Array((await inflate(amounts)).buffer);
    return correctives;
  }

  add({ first, next, share }, rest, surface) {
    surface.set(rest);
    for (let k = 0; k < this.rank; k += 1) {
      const amount = this.amounts[first * this.rank + k] * (1 - share)
        + this.amounts[next * this.rank + k] * share;
      const start = k * rest.length;
      for (let i = 0; i < rest.length; i += 1) surface[i] += amount * this.directions[start + i];
    }
  }
}
