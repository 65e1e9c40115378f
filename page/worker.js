// The engine, in a thread of its own. decodeBase64() stands before this text.

const memoryProblem = 'There is too little memory for this volume. Close other pages, or use a page with a smaller volume.';
let engine = null;
let bits = 8;
let parameters = null;

const call = (name, ...values) => {
  let status = 0;
  try {
    status = engine[name](...values);
  } catch {
    throw new Error(memoryProblem);
  }
  if (status !== 0) {
    throw new Error(readText(engine.GetError() >>> 0));
  }
};

function readText(start) {
  const bytes = new Uint8Array(engine.memory.buffer, start);
  return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
}

function allocate(bytes) {
  const start = bytes < 2 ** 32 ? engine.malloc(bytes) >>> 0 : 0;
  if (start === 0) {
    throw new Error(memoryProblem);
  }
  return start;
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
  throw new Error(`This page is damaged: its ${what} cannot be read (${problem.message}).`);
};

async function readEngine(text) {
  const parts = [];
  await unpack(text, (part) => parts.push(part)).catch(sayDamaged('engine'));
  const bytes = await new Blob(parts).arrayBuffer();
  const { instance } = await WebAssembly.instantiate(bytes, {}).catch(sayDamaged('engine'));
  engine = instance.exports;
  engine._initialize();
}

/** Byte planes become voxels, at their place. Returns the least and the greatest one. */
async function readVoxels(text, start, count) {
  const stride = bits / 8;
  const voxels = new Uint8Array(engine.memory.buffer, start, count * stride);
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
  return findRange(view(start, count));
}

const view = (start, count) => new (bits === 8 ? Uint8Array : Uint16Array)(engine.memory.buffer, start, count);

function findRange(values) {
  let [least, most] = [values[0], values[0]];
  for (const value of values) {
    least = value < least ? value : least;
    most = value > most ? value : most;
  }
  return [least, most];
}

async function start({ engine: code, voxels, bits: depth, size, toPhysical }) {
  bits = depth;
  const count = size[0] * size[1] * size[2];
  await readEngine(code);
  parameters = allocate(18 * 8);
  const place = allocate(count * bits / 8);
  const range = await readVoxels(voxels, place, count);
  setNumbers(toPhysical);
  call('SetVolume', bits, ...size, parameters, place);
  return { range };
}

const setNumbers = (numbers) => new Float64Array(engine.memory.buffer, parameters, numbers.length).set(numbers);

function project({ view: matrix, picture, mode, slab, isExact, hasDepth }) {
  const [columns, rows] = picture;
  setNumbers([...matrix, ...picture]);
  const begin = performance.now();
  call('Project', parameters, parameters + 12 * 8, mode, ...slab, isExact, hasDepth);
  const milliseconds = performance.now() - begin;
  const values = view(engine.GetPixels() >>> 0, columns * rows).slice();
  const depths = hasDepth ? new Float32Array(engine.memory.buffer, engine.GetDepths() >>> 0, columns * rows).slice() : null;
  return { values, depths, milliseconds };
}

onmessage = async ({ data }) => {
  try {
    const answer = await (data.engine ? start : project)(data);
    postMessage(answer, answer.values ? [answer.values.buffer] : []);
  } catch (problem) {
    postMessage({ problem: problem.message });
  }
};
