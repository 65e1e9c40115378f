// ---- PNG. Reading pixels back from a canvas would not do: browsers that resist fingerprinting add noise to them.

const predictors = [
  () => 0,
  (left) => left,
  (left, above) => above,
  (left, above) => (left + above) >> 1,
  (left, above, corner) => {
    const toLeft = Math.abs(above - corner);
    const toAbove = Math.abs(left - corner);
    const toCorner = Math.abs(left + above - 2 * corner);
    if (toLeft <= toAbove && toLeft <= toCorner) {
      return left;
    }
    return toAbove <= toCorner ? above : corner;
  },
];

function readChunks(png) {
  const view = new DataView(png.buffer);
  const chunks = { IHDR: [], IDAT: [] };
  for (let offset = 8; offset < png.length; ) {
    const length = view.getUint32(offset);
    const type = String.fromCharCode(...png.subarray(offset + 4, offset + 8));
    chunks[type]?.push(png.subarray(offset + 8, offset + 8 + length));
    offset += length + 12;
  }
  return chunks;
}

function readHeader([header]) {
  const view = new DataView(header.buffer, header.byteOffset, header.length);
  const [depth, colourType, , , interlaced] = header.subarray(8);
  const channels = { 0: 1, 2: 3 }[colourType];
  if (!channels || depth < 8 || interlaced) {
    throw new Error('it is not a plain gray or RGB PNG');
  }
  return { width: view.getUint32(0), height: view.getUint32(4), pixelLength: channels * depth / 8 };
}

async function inflate(parts) {
  const stream = new Blob(parts).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function unfilter(filtered, rowLength, pixelLength) {
  const rowCount = filtered.length / (rowLength + 1);
  const bytes = new Uint8Array(rowCount * rowLength);
  let above = new Uint8Array(rowLength);
  for (let row = 0; row < rowCount; ++row) {
    const start = row * (rowLength + 1);
    const predict = predictors[filtered[start]];
    const current = bytes.subarray(row * rowLength, (row + 1) * rowLength);
    for (let n = 0; n < pixelLength; ++n) {
      current[n] = filtered[start + 1 + n] + predict(0, above[n], 0);
    }
    for (let n = pixelLength; n < rowLength; ++n) {
      const left = n - pixelLength;
      current[n] = filtered[start + 1 + n] + predict(current[left], above[n], above[left]);
    }
    above = current;
  }
  return bytes;
}

/** The stored values of a gray PNG of 8 or 16 bits, or of an RGB PNG with the high byte in red and the low in green; of 24
 * bits the colours of an RGB PNG as ImageData has them. */
async function decodeFrame(base64, { width, height, bits }) {
  const chunks = readChunks(decodeBase64(base64));
  const header = readHeader(chunks.IHDR);
  const { pixelLength } = header;
  const isDeep = { 8: [1], 16: [2, 3], 24: [3] }[bits].includes(pixelLength);
  if (header.width !== width || header.height !== height || !isDeep) {
    throw new Error('it has another size or depth');
  }
  const bytes = unfilter(await inflate(chunks.IDAT), width * pixelLength, pixelLength);
  if (bytes.length !== width * height * pixelLength) {
    throw new Error('it is cut short');
  }
  if (bits === 8) {
    return bytes;
  }
  if (bits === 24) {
    const colours = new Uint32Array(width * height);
    for (let n = 0; n < colours.length; ++n) {
      colours[n] = 0xff000000 | bytes[3 * n + 2] << 16 | bytes[3 * n + 1] << 8 | bytes[3 * n];
    }
    return colours;
  }
  const values = new Uint16Array(width * height);
  for (let n = 0; n < values.length; ++n) {
    values[n] = bytes[n * pixelLength] << 8 | bytes[n * pixelLength + 1];
  }
  return values;
}

// ---- The order in which the frames follow

/** Frames of a turn in the order in which they pass while the pointer goes right. Angles grow as the viewer goes to the
 * right of the picture: what is in front follows the pointer when they fall. */
function makeDragOrder(count, angles, loop) {
  const order = [...Array(count).keys()];
  if (!angles || order.length < 2) {
    return order;
  }
  if (loop === 'swing') {
    const byAngle = new Map(order.map((frame) => [angles[frame].toFixed(3), frame]).reverse());
    return [...byAngle.values()].sort((first, second) => angles[second] - angles[first]);
  }
  return angles[0] < angles[1] ? order.reverse() : order;
}

function placeInOrder(order, frame, angles) {
  const exact = order.indexOf(frame);
  return exact >= 0 ? exact : order.findIndex((other) => Math.abs(angles[other] - angles[frame]) < 1e-3);
}

/** The frame after position steps from the first one. */
function frameAt(position, count, loop) {
  const last = count - 1;
  if (loop !== 'none') {
    return modulo(position, count);
  }
  return last === 0 ? 0 : last - Math.abs(modulo(position, 2 * last) - last);
}

// ---- Frames that were made before

function makeFrames(series, viewer) {
  const { width, height, spacing, angles, loop } = series;
  const origin = series.origin ?? [-(width - 1) / 2 * spacing[0], -(height - 1) / 2 * spacing[1]];
  const elevations = series.elevations ?? [0];
  const rows = [...elevations.keys()].sort((first, second) => elevations[first] - elevations[second]);
  const firstRow = [...rows].sort((first, second) => Math.abs(elevations[first]) - Math.abs(elevations[second]))[0];
  const count = series.frames.length / rows.length;
  const storedValues = Array(series.frames.length).fill(null);
  const dragOrder = makeDragOrder(count, angles, loop);
  const dragWraps = loop === 'turn' || (loop === 'swing' && !angles);

  const state = { frame: 0, row: firstRow, rate: series.rate, playing: false, loaded: 0 };
  const range = [Infinity, -Infinity];
  let player = 0;

  const index = () => state.row * count + state.frame;

  function describe() {
    const angle = angles ? formatDegrees(angles[state.frame]) : '';
    const elevation = rows.length > 1 ? `elevation ${formatDegrees(elevations[state.row])}` : '';
    const spoken = [`Frame ${state.frame + 1} of ${count}`, angle, elevation].filter(Boolean).join(', ');
    element('frame-number').textContent = `${state.frame + 1} / ${count}`;
    element('angle').textContent = angle;
    element('elevation').textContent = elevation;
    element('position').value = state.frame + 1;
    element('position').setAttribute('aria-valuetext', spoken);
    return { spoken, letters: series.letters?.[index()].split(' ') };
  }

  function showRate() {
    element('speed').value = state.rate;
    element('rate').textContent = `${Number(state.rate.toFixed(1))} fps`;
  }

  function show(frame, row = state.row) {
    if (storedValues[row * count + frame]) {
      Object.assign(state, { frame, row });
      viewer.draw();
    }
  }

  function step(steps) {
    pause();
    const frame = state.frame + steps;
    show(loop === 'none' ? clamp(frame, 0, count - 1) : modulo(frame, count));
  }

  function rise(steps) {
    show(state.frame, rows[clamp(rows.indexOf(state.row) + steps, 0, rows.length - 1)]);
  }

  function play() {
    if (count < 2) {
      return;
    }
    state.playing = true;
    viewer.showPlaying(state.playing);
    let position = state.frame;
    let shownAt = performance.now();
    const tick = (now) => {
      const steps = Math.floor((now - shownAt) * state.rate / 1000);
      if (state.playing && steps > 0) {
        const frame = frameAt(position + steps, count, loop);
        position += storedValues[state.row * count + frame] ? steps : 0;
        shownAt += steps * 1000 / state.rate;
        show(frame);
      }
      player = state.playing ? requestAnimationFrame(tick) : 0;
    };
    player = requestAnimationFrame(tick);
  }

  function pause() {
    cancelAnimationFrame(player);
    state.playing = false;
    viewer.showPlaying(state.playing);
  }

  function reset() {
    const wasPlaying = state.playing;
    pause();
    state.rate = series.rate;
    showRate();
    show(0, firstRow);
    if (wasPlaying) {
      play();
    }
  }

  // Mouse and fingers

  let dragPlace = 0;
  let dragRow = 0;
  let wheelSteps = 0;

  /** Down: what is in front follows the pointer, so that the viewer rises. */
  function tilt(pixelsDown) {
    dragRow = clamp(dragRow + pixelsDown / Math.min(96, viewer.stage.clientHeight / rows.length), 0, rows.length - 1);
    show(state.frame, rows[Math.round(dragRow)]);
  }

  function turn(pixelsRight) {
    const pixelsPerFrame = Math.min(48, element('picture').clientWidth * (dragWraps ? 2 : 1) / dragOrder.length);
    dragPlace += pixelsRight / pixelsPerFrame;
    dragPlace = dragWraps ? modulo(dragPlace, count) : clamp(dragPlace, 0, dragOrder.length - 1);
    pause();
    show(dragOrder[Math.round(dragPlace) % dragOrder.length]);
  }

  const drag = {
    begin() {
      dragRow = rows.indexOf(state.row);
      dragPlace = placeInOrder(dragOrder, state.frame, angles);
    },
    move(right, down) {
      if (right !== 0) {
        turn(right);
      }
      tilt(down);
    },
  };

  function wheel(notches) {
    wheelSteps += notches;
    const steps = Math.trunc(wheelSteps);
    wheelSteps -= steps;
    if (steps !== 0) {
      step(steps);
    }
    return true;
  }

  const keys = {
    ' ': () => (state.playing ? pause() : play()),
    ArrowLeft: () => step(-1),
    ArrowRight: () => step(1),
    Home: () => step(-state.frame),
    End: () => step(count - 1 - state.frame),
    ...(rows.length > 1 && { ArrowUp: () => rise(1), ArrowDown: () => rise(-1) }),
  };

  const inputs = {
    position({ valueAsNumber }) {
      pause();
      show(valueAsNumber - 1);
      describe();
    },
    speed({ valueAsNumber }) {
      state.rate = valueAsNumber;
      showRate();
    },
  };

  // Start

  function prepare() {
    element('position').max = count;
    element('loading').max = storedValues.length;
    [element('drag-help').textContent, element('vertical-keys').textContent] = rows.length > 1
      ? ['left or right: turn; up or down: elevation', 'elevation']
      : ['left or right: turn', 'brighter and darker (window level)'];
    for (const [name, colour] of series.segments ?? []) {
      const [entry, mark] = ['li', 'b'].map((tag) => document.createElement(tag));
      Object.assign(mark, { textContent: '■', ariaHidden: true }).style.color = colour;
      entry.append(mark, name);
      element('segments').append(entry);
    }
    if (viewer.isColoured) {
      element('vertical').hidden = rows.length < 2;
      element('display-help').textContent = 'what is shown';
      element('display').title = element('display').ariaLabel = element('display-title').textContent = 'Display';
    }
    for (const id of ['play', 'previous', 'next', 'position', 'speed']) {
      element(id).disabled = count < 2;
    }
    showRate();
  }

  async function load() {
    prepare();
    const order = [firstRow, ...rows.filter((row) => row !== firstRow)];
    for (const frame of order.flatMap((row) => Array.from({ length: count }, (_, n) => row * count + n))) {
      const values = await decodeFrame(series.frames[frame], series).catch((problem) => {
        throw new Error(`Frame ${frame + 1} cannot be shown: ${problem.message}.`);
      });
      storedValues[frame] = values;
      series.frames[frame] = null;
      extendRange(values);
      element('loading').value = ++state.loaded;
      if (state.loaded === 1) {
        begin();
      }
    }
    element('loading').hidden = true;
    viewer.setRange(...range);
  }

  function extendRange(values) {
    if (viewer.isColoured) {
      return;
    }
    let [low, high] = [Infinity, -Infinity];
    for (const stored of values) {
      if (stored !== series.background) {
        low = Math.min(low, stored);
        high = Math.max(high, stored);
      }
    }
    range[0] = Math.min(range[0], viewer.toValue(low));
    range[1] = Math.max(range[1], viewer.toValue(high));
  }

  function begin() {
    viewer.setRange(...range);
    show(0);
    if (!matchMedia('(prefers-reduced-motion: reduce)').matches) {
      play();
    }
  }

  const tests = {
    get frame() { return state.frame; },
    get row() { return state.row; },
    get playing() { return state.playing; },
    get rate() { return state.rate; },
    get loaded() { return state.loaded; },
  };

  return {
    width,
    height,
    spacing,
    origin,
    extent: [width * spacing[0], height * spacing[1]],
    get values() { return storedValues[index()]; },
    get name() { return index() + 1; },
    describe,
    drag,
    wheel,
    click() {},
    place() {},
    reset,
    keys,
    buttons: { play: keys[' '], previous: keys.ArrowLeft, next: keys.ArrowRight },
    inputs,
    tests,
    load,
  };
}
