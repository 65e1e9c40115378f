// The engine, in a thread of its own. decodeBase64() stands before this text.

const memoryProblem = 'There is too little memory for this volume. Close other pages, or use a page with a smaller volume.';
const stopProblem = 'The engine of this page has stopped, perhaps for want of memory. Close other pages and open this one again, '
  + 'or use a page with a smaller volume.';
let bits = 8;
let volume = null;
let fine = null;
let coarse = null;

class Engine {
  constructor(module) {
    this.exports = new WebAssembly.Instance(module).exports;
    this.exports._initialize();
    this.parameters = this.allocate(18 * 8);
  }

  allocate(bytes) {
    const start = bytes < 2 ** 32 ? this.exports.malloc(bytes) >>> 0 : 0;
    if (start === 0) {
      throw new Error(memoryProblem);
    }
    return start;
  }

  call(name, ...values) {
    if (this.exports[name](...values) !== 0) {
      const bytes = new Uint8Array(this.exports.memory.buffer, this.exports.GetError() >>> 0);
      throw new Error(new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0))));
    }
  }

  /** Voxels or pixels; memory that grows leaves its views. */
  view(start, count) {
    return new (bits === 8 ? Uint8Array : Uint16Array)(this.exports.memory.buffer, start, count);
  }

  setNumbers(numbers) {
    new Float64Array(this.exports.memory.buffer, this.parameters, numbers.length).set(numbers);
  }

  setVolume({ size, toPhysical, start }) {
    this.setNumbers(toPhysical);
    this.call('SetVolume', bits, ...size, this.parameters, start);
  }
}

/** Gives the bytes to take(), part by part. */
async function unpack(text, take) {
  const step = 1 << 20; // characters, four for three bytes
  let next = 0;
  const packed = new ReadableStream({
    pull(controller) {
      if (next >= text.length) {
        controller.close();
      } else {
        controller.enqueue(decodeBase64(text.slice(next, next += step)));
      }
    },
  });
  const reader = packed.pipeThrough(new DecompressionStream('gzip')).getReader();
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    take(part.value, Math.min(next / text.length, 1));
  }
}

const sayDamaged = (what) => (problem) => {
  throw new Error(`This page is damaged: its ${what} cannot be read (${problem.message.replace(/\.$/, '')}).`);
};

async function readEngine(text) {
  const parts = [];
  await unpack(text, (part) => parts.push(part)).catch(sayDamaged('engine'));
  return WebAssembly.compile(await new Blob(parts).arrayBuffer()).catch(sayDamaged('engine'));
}

/** Byte planes become voxels. */
async function readVoxels(text, values) {
  const count = values.length;
  const stride = bits / 8;
  const voxels = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
  let done = 0;
  let shown = 0;
  await unpack(text, (part, fraction) => {
    if (done + part.length > voxels.length) {
      throw new Error('it is too long');
    }
    for (let n = 0; n < part.length; ) {
      const plane = Math.floor(done / count);
      const end = Math.min(part.length, n + (plane + 1) * count - done);
      let place = (done - plane * count) * stride + plane;
      done += end - n;
      for (; n < end; ++n, place += stride) {
        voxels[place] = part[n];
      }
    }
    if (fraction > shown + 0.01) {
      shown = fraction;
      postMessage({ fraction });
    }
  }).catch(sayDamaged('volume'));
  if (done < voxels.length) {
    sayDamaged('volume')(new Error('it is cut short'));
  }
}

function findRange(values) {
  let [least, most] = [values[0], values[0]];
  for (const value of values) {
    least = value < least ? value : least;
    most = value > most ? value : most;
  }
  return [least, most];
}

async function start({ engine, voxels, bits: depth, size, toPhysical }) {
  bits = depth;
  const module = await readEngine(engine);
  fine = new Engine(module);
  const count = size[0] * size[1] * size[2];
  volume = { module, size, toPhysical, start: fine.allocate(count * bits / 8) };
  const values = fine.view(volume.start, count);
  await readVoxels(voxels, values);
  const range = findRange(values);
  fine.setVolume(volume);
  return { range };
}

/** An engine with half the resolution: the greatest voxel of eight. Without memory for it, the fine one. */
function makeCoarse() {
  try {
    const [columns, rows, slices] = volume.size;
    const size = volume.size.map((length) => Math.ceil(length / 2));
    const engine = new Engine(volume.module);
    const start = engine.allocate(size[0] * size[1] * size[2] * bits / 8);
    const source = fine.view(volume.start, columns * rows * slices);
    const target = engine.view(start, size[0] * size[1] * size[2]).fill(0);
    for (let slice = 0, place = 0; slice < slices; ++slice) {
      for (let row = 0; row < rows; ++row) {
        const first = ((slice >> 1) * size[1] + (row >> 1)) * size[0];
        for (let column = 0; column < columns; ++column, ++place) {
          const at = first + (column >> 1);
          target[at] = Math.max(target[at], source[place]);
        }
      }
    }
    const toPhysical = [0, 4, 8].flatMap((row) => {
      const [i, j, k, origin] = volume.toPhysical.slice(row, row + 4);
      return [2 * i, 2 * j, 2 * k, origin + (i + j + k) / 2];
    });
    engine.setVolume({ size, toPhysical, start });
    return engine;
  } catch {
    return fine;
  }
}

function project({ view, picture, mode, slab, isExact, isCoarse, hasDepth }) {
  const engine = isCoarse ? coarse ??= makeCoarse() : fine;
  const { exports, parameters } = engine;
  const [columns, rows] = picture;
  engine.setNumbers([...view, ...picture]);
  const begin = performance.now();
  engine.call('Project', parameters, parameters + 12 * 8, mode, ...slab, isExact, hasDepth);
  const milliseconds = performance.now() - begin;
  const values = engine.view(exports.GetPixels() >>> 0, columns * rows).slice();
  const depths = hasDepth
    ? new Float32Array(exports.memory.buffer, exports.GetDepths() >>> 0, columns * rows).slice() : null;
  return { values, depths, milliseconds };
}

onmessage = async ({ data }) => {
  try {
    const answer = await ('engine' in data ? start : project)(data);
    postMessage(answer, answer.values ? [answer.values.buffer] : []);
  } catch (problem) {
    // other errors are the browser's: a trap, or no memory for a picture
    postMessage({ problem: problem.constructor === Error ? problem.message : stopProblem });
  }
};
