const element = (id) => document.getElementById(id);
const clamp = (number, least, most) => Math.min(Math.max(number, least), most);
const modulo = (number, divisor) => ((number % divisor) + divisor) % divisor;

function decodeBase64(text) {
  const characters = atob(text);
  const bytes = new Uint8Array(characters.length);
  for (let n = 0; n < bytes.length; ++n) {
    bytes[n] = characters.charCodeAt(n);
  }
  return bytes;
}

// ---- Text

const words = { L: 'left', R: 'right', A: 'anterior', P: 'posterior', H: 'head', F: 'feet' };
const speak = (letters) => [...letters].map((letter) => words[letter]).join(' ');
const formatDegrees = (angle) => `${Number(angle.toFixed(1))}°`.replace('-', '\u2212');

function format(number, resolution) {
  const decimals = Math.max(0, Math.ceil(-Math.log10(Math.abs(resolution)) - 1e-9));
  const text = decimals > 6 ? number.toExponential(3) : number.toFixed(decimals);
  return (Number(text) === 0 ? text.replace('-', '') : text).replace('-', '\u2212');
}

function roundLength(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return [5, 2, 1].map((digit) => digit * power).find((length) => length <= most) ?? power;
}

/** A length in mm as text, in a smaller unit below 0.1. */
function formatLength(length) {
  const [factor, unit] = length > 0.09 ? [1, 'mm'] : length > 0.00009 ? [1e3, 'µm'] : [1e6, 'nm'];
  return `${Number((length * factor).toPrecision(1))} ${unit}`;
}

// ---- The viewer of pictures, which come from frames or from a volume

/** makeSource(series, viewer) returns the source of the pictures:
 *
 * width, height, spacing, origin  their pixels, in mm
 * extent      mm that fill the stage, across and along
 * values      stored values of the picture that is shown, or null
 * name        of the picture, for its file
 * describe()  writes the source's own texts of the picture; returns what is spoken, and letters of the four edges or null
 * drag        begin(), and move(right, down) in pixels of the page
 * wheel(notches)
 * click(column, row)
 * place()     called when the picture was moved on the page
 * reset()
 * keys        actions by key
 * buttons     actions by id
 * inputs      actions by id, with the element
 * tests       getters, for tests
 * load()      begins, and ends when all is loaded */
function startViewer(series, makeSource) {
  const { slope, intercept } = series;
  const isColoured = series.bits === 24;
  const toValue = (stored) => slope * stored + intercept;
  const [lowest, highest] = series.cut ?? [];
  const describeValue = (stored) =>
    `${stored === lowest ? '≤ ' : stored === highest ? '≥ ' : ''}${format(toValue(stored), slope)}`;
  const ends = [toValue(0), toValue(2 ** series.bits - 1), ...series.window];
  const least = Math.min(...ends);
  const most = Math.max(...ends);
  const narrowest = Math.min(Math.abs(slope), series.window[1] - series.window[0]);

  const stage = element('stage');
  const canvas = element('picture');
  const context = canvas.getContext('2d', { alpha: false });

  // the point in the middle of the stage is center mm from the picture's center
  const state = {};
  let automatic = series.window;
  let range = series.window;
  let presets = {};
  let greys = null;
  let pointed = null;

  const windowWidth = () => state.high - state.low;
  const windowLevel = () => (state.low + state.high) / 2;

  const viewer = {
    toValue,
    describeValue,
    stage,
    isColoured,
    get window() { return [state.low, state.high]; },
    draw,
    setRange,
    useWindow,
    showPlaying,
    setTitle,
  };
  const source = makeSource(series, viewer);
  const { width, height, spacing, origin, extent } = source;
  const size = [width * spacing[0], height * spacing[1]];
  const image = new ImageData(width, height);
  const pixels = new Uint32Array(image.data.buffer);

  function setDefaults() {
    const [low, high] = automatic = series.window;
    Object.assign(state, { low, high, inverted: series.inverted, zoom: 1, center: [0, 0], labels: series.labels ?? true });
  }

  // Display

  function makeGreys() {
    const table = new Uint32Array(2 ** series.bits);
    for (let stored = 0; stored < table.length; ++stored) {
      const fraction = clamp((toValue(stored) - state.low) / (state.high - state.low), 0, 1);
      const brightness = stored === series.background ? 0 : Math.round(255 * fraction);
      const grey = state.inverted ? 255 - brightness : brightness;
      table[stored] = 0xff000000 | grey * 0x010101;
    }
    return table;
  }

  function draw() {
    const { values } = source;
    if (!values) {
      return;
    }
    if (isColoured) {
      pixels.set(values);
    } else {
      greys ??= makeGreys();
      for (let n = 0; n < pixels.length; ++n) {
        pixels[n] = greys[values[n]];
      }
    }
    context.putImageData(image, 0, 0);
    showDescription();
    showValue();
  }

  /** Pixels of the page for a millimetre. */
  const getScale = () => state.zoom * Math.min(stage.clientWidth / extent[0], stage.clientHeight / extent[1]);

  function place() {
    const scale = getScale();
    const shown = size.map((length) => Math.round(length * scale));
    const [left, top] = [stage.clientWidth, stage.clientHeight].map((length, axis) =>
      Math.round((length - shown[axis]) / 2 - state.center[axis] * scale));
    Object.assign(canvas.style, { width: `${shown[0]}px`, height: `${shown[1]}px`, left: `${left}px`, top: `${top}px` });
    canvas.classList.toggle('enlarged', shown[0] * devicePixelRatio >= 4 * width);
    const length = roundLength(Math.min(extent[0], stage.clientWidth / scale) / 4);
    element('scale-bar').style.width = `${length * scale}px`;
    element('scale-length').textContent = formatLength(length);
    source.place();
  }

  /** The screen's pixels change with the browser's zoom, and when the window goes to another screen. */
  function placeAtEachResolution() {
    matchMedia(`(resolution: ${devicePixelRatio}dppx)`).addEventListener('change', () => {
      place();
      placeAtEachResolution();
    }, { once: true });
  }

  function move(right, down) {
    const scale = getScale();
    state.center = [right, down].map((length, axis) =>
      clamp(state.center[axis] - length / scale, -size[axis] / 2, size[axis] / 2));
    place();
  }

  /** About a point so far right of and below the stage's middle, which stays where it is. */
  function zoom(factor, right = 0, down = 0) {
    const before = state.zoom;
    state.zoom = clamp(before * factor, 0.5, 32);
    const change = 1 - state.zoom / before;
    move(right * change, down * change);
  }

  function findFromMiddle({ clientX, clientY }) {
    const box = stage.getBoundingClientRect();
    return [clientX - box.left - box.width / 2, clientY - box.top - box.height / 2];
  }

  function showLabels() {
    element('labels').hidden = !state.labels;
    element('labels-shown').checked = state.labels;
  }

  function showDescription() {
    const { spoken, letters } = source.describe();
    const sides = ['left', 'right', 'top', 'bottom'];
    sides.forEach((side, n) => { element(`${side}-letter`).textContent = letters?.[n] ?? ''; });
    const edges = letters ? `. Patient: ${sides.map((side, n) => `${speak(letters[n])} at the ${side}`).join(', ')}` : '';
    canvas.setAttribute('aria-label', [series.title, spoken + edges].filter(Boolean).join('. '));
  }

  function showWindow() {
    if (isColoured) {
      return;
    }
    const resolution = Math.min(Math.abs(slope), windowWidth() / 100);
    element('window-width').textContent = `Width ${format(windowWidth(), resolution)}`;
    element('window-level').textContent = `Level ${format(windowLevel(), resolution)}`;
    element('invert').setAttribute('aria-pressed', state.inverted);
    element('level').value = Number(windowLevel().toPrecision(7));
    element('width').value = Number(windowWidth().toPrecision(7));
    element('typed-problem').hidden = true;
    const isChosen = ([, [low, high]]) => low === state.low && high === state.high;
    element('preset').value = Object.entries(presets).find(isChosen)?.[0] ?? '';
  }

  function showValue() {
    const { values } = source;
    const stored = pointed && values ? values[pointed.row * width + pointed.column] : undefined;
    if (stored === undefined) {
      element('value').textContent = element('place').textContent = '';
      return;
    }
    const [u, v] = [pointed.column, pointed.row].map((n, axis) =>
      format(origin[axis] + n * spacing[axis], Math.min(spacing[axis], 0.1)));
    element('value').textContent = isColoured ? '' : stored === series.background ? 'no data' : describeValue(stored);
    element('place').textContent = `${u}, ${v} mm`;
  }

  function setTitle(title) {
    document.title = element('title').textContent = series.title = title;
  }

  function showPlaying(isPlaying) {
    const button = element('play');
    const label = isPlaying ? 'Pause' : 'Play';
    button.classList.toggle('playing', isPlaying);
    button.setAttribute('aria-label', label);
    button.title = `${label} (Space)`;
  }

  // Window

  /** The least and the greatest value. */
  function setRange(low, high) {
    range = low < high ? [low, high] : series.window;
    makePresets();
  }

  /** Sets a window, and the one that is called automatic. */
  function useWindow(window, newAutomatic) {
    automatic = newAutomatic;
    makePresets();
    setWindow(...window);
  }

  function makePresets() {
    presets = { Automatic: automatic, 'Full range': range };
    if (range[0] <= -100) {
      // as usual for CT, in HU
      Object.assign(presets, { Lung: [-1350, 150], Bone: [-450, 1050], Angio: [0, 600], Brain: [0, 80] });
    }
    const choices = Object.keys(presets).map((name) => new Option(name));
    element('preset').replaceChildren(...choices, new Option('As set', '', true, true));
    element('preset').lastChild.hidden = true;
    showWindow();
  }

  function setWindow(low, high) {
    if (!isColoured) {
      Object.assign(state, { low, high });
      applyWindow();
    }
  }

  function setTypedWindow() {
    const [level, width] = ['level', 'width'].map((id) => element(id).valueAsNumber);
    const [low, high] = [level - width / 2, level + width / 2];
    if (low < high && Number.isFinite(high - low)) {
      setWindow(low, high);
    } else {
      element('typed-problem').hidden = false;
    }
  }

  function applyWindow() {
    greys = null;
    showWindow();
    draw();
  }

  function changeWindow(widthFactor, levelShift) {
    const width = clamp(windowWidth() * widthFactor, narrowest, 2 * (most - least));
    const level = clamp(windowLevel() + levelShift, least, most);
    setWindow(level - width / 2, level + width / 2);
  }

  const widen = (factor) => changeWindow(factor, 0);
  const moveLevel = (partOfWidth) => changeWindow(1, partOfWidth * windowWidth());

  function invert() {
    state.inverted = !state.inverted && !isColoured;
    applyWindow();
  }

  function reset() {
    setDefaults();
    makePresets();
    showLabels();
    place();
    source.reset();
    applyWindow();
  }

  // Mouse and fingers

  const clickPixels = 3;
  const pointers = new Map();
  let gesture = null;
  let moved = 0;
  let dragWidth = 0;

  /** The middle of the fingers, and how far they are apart. */
  function measure() {
    const [first, second = first] = [...pointers.values()];
    return {
      clientX: (first.x + second.x) / 2,
      clientY: (first.y + second.y) / 2,
      distance: first === second ? 1 : Math.max(1, Math.hypot(second.x - first.x, second.y - first.y)),
    };
  }

  function point(event) {
    const box = canvas.getBoundingClientRect();
    const column = Math.floor((event.clientX - box.left) / box.width * width);
    const row = Math.floor((event.clientY - box.top) / box.height * height);
    const inside = column >= 0 && column < width && row >= 0 && row < height;
    pointed = inside ? { column, row } : null;
    showValue();
  }

  function beginGesture(event) {
    if (event.button > 2) {
      return;
    }
    stage.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    gesture = pointers.size > 1 || event.button === 1 || event.shiftKey ? 'pan' : event.button === 2 ? 'window' : 'turn';
    moved = 0;
    dragWidth = windowWidth();
    if (gesture === 'turn') {
      source.drag.begin();
    }
    stage.className = { turn: 'turning', window: 'windowing', pan: 'panning' }[gesture];
    point(event);
  }

  function continueGesture(event) {
    point(event);
    if (!pointers.has(event.pointerId)) {
      return;
    }
    const before = measure();
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    const after = measure();
    const right = after.clientX - before.clientX;
    const down = after.clientY - before.clientY;
    moved += Math.abs(right) + Math.abs(down);
    if (gesture === 'pan') {
      move(right, down);
      zoom(after.distance / before.distance, ...findFromMiddle(after));
    } else if (gesture === 'window') {
      changeWindow(2 ** (right / 150), down / 300 * dragWidth);
    } else {
      source.drag.move(right, down);
    }
  }

  function endGesture(event) {
    pointers.delete(event.pointerId);
    if (pointers.size === 0) {
      stage.className = '';
    }
  }

  function onClick(event) {
    point(event);
    if (gesture === 'turn' && moved <= clickPixels && pointed) {
      source.click(pointed.column, pointed.row);
    }
  }

  function onWheel(event) {
    event.preventDefault();
    const notches = clamp((event.deltaY || event.deltaX) / 50, -1, 1);
    if (event.ctrlKey || !source.wheel(notches)) {
      zoom(1.2 ** -notches, ...findFromMiddle(event));
    }
  }

  function listenToPointers() {
    stage.addEventListener('pointerdown', beginGesture);
    stage.addEventListener('pointermove', continueGesture);
    stage.addEventListener('lostpointercapture', endGesture);
    stage.addEventListener('pointerleave', () => {
      pointed = null;
      showValue();
    });
    stage.addEventListener('wheel', onWheel, { passive: false });
    stage.addEventListener('click', onClick);
    stage.addEventListener('dblclick', reset);
    stage.addEventListener('mousedown', (event) => event.button === 1 && event.preventDefault());
    stage.addEventListener('contextmenu', (event) => event.preventDefault());
  }

  // Keys and buttons

  function toggleHelp() {
    const box = element('help-box');
    return box.open ? box.close() : box.showModal();
  }

  function toggleDisplay() {
    const box = element('display-box');
    if (box.open) {
      box.close();
      box.querySelector(':focus')?.blur();
    } else {
      showWindow();
      box.show();
    }
    element('display').setAttribute('aria-expanded', box.open);
  }

  function toggleLabels() {
    state.labels = !state.labels;
    showLabels();
  }

  function toggleFullScreen() {
    const change = document.fullscreenElement
      ? document.exitFullscreen() : document.documentElement.requestFullscreen?.();
    change?.catch(() => {});
  }

  const keys = {
    ArrowUp: () => moveLevel(-0.05),
    ArrowDown: () => moveLevel(0.05),
    'Shift+ArrowLeft': () => move(-40, 0),
    'Shift+ArrowRight': () => move(40, 0),
    'Shift+ArrowUp': () => move(0, -40),
    'Shift+ArrowDown': () => move(0, 40),
    '+': () => widen(1.1),
    '=': () => widen(1.1),
    '-': () => widen(1 / 1.1),
    '−': () => widen(1 / 1.1),
    z: () => zoom(1.2),
    'Shift+z': () => zoom(1 / 1.2),
    i: invert,
    l: toggleLabels,
    r: reset,
    s: savePicture,
    w: toggleDisplay,
    f: toggleFullScreen,
    h: toggleHelp,
    '?': toggleHelp,
    ...source.keys,
    Escape: () => (element('display-box').open ? toggleDisplay() : source.keys.Escape?.()),
  };

  function belongsToControl(key, target) {
    return target.matches('button, [type="checkbox"]') ? key === ' '
      : target.matches('select, [type="number"]') ? key !== 'Escape'
      : target.matches('input') && /^(Arrow|Home|End)/.test(key);
  }

  function onKey(event) {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const action = (event.shiftKey && keys[`Shift+${key}`]) || (Object.hasOwn(keys, key) ? keys[key] : null);
    // some keyboards have brackets behind AltGr, which is Ctrl with Alt
    const isCommand = (event.ctrlKey || event.altKey) && !event.getModifierState('AltGraph');
    const isForBrowser = isCommand || event.metaKey || belongsToControl(key, event.target);
    const isBehindHelp = element('help-box').open && action !== toggleHelp;
    if (!action || isForBrowser || isBehindHelp) {
      return;
    }
    event.preventDefault();
    action();
  }

  function listenToControls() {
    const actions = {
      invert, reset, save: savePicture, 'full-screen': toggleFullScreen, help: toggleHelp, 'close-help': toggleHelp,
      display: toggleDisplay, 'close-display': toggleDisplay, 'labels-shown': toggleLabels, ...source.buttons,
    };
    for (const [id, action] of Object.entries(actions)) {
      element(id).addEventListener('click', action);
    }
    for (const [id, action] of Object.entries(source.inputs)) {
      element(id).addEventListener(element(id).type === 'range' ? 'input' : 'change', (event) => action(event.target));
    }
    element('preset').addEventListener('change', (event) => setWindow(...presets[event.target.value]));
    element('level').addEventListener('change', setTypedWindow);
    element('width').addEventListener('change', setTypedWindow);
    keepKeysForPicture();
    document.addEventListener('keydown', onKey);
  }

  /** A control that was clicked does not take the keys; one that was reached with Tab does. */
  function keepKeysForPicture() {
    element('controls').addEventListener('mousedown', (event) => {
      if (event.target.closest('button')) {
        event.preventDefault();
      }
    });
    element('controls').addEventListener('pointerup', (event) => event.target.matches('input') && event.target.blur());
    let clicked = null;
    element('controls').addEventListener('pointerdown', (event) => { clicked = event.target; });
    element('controls').addEventListener('change', (event) => {
      if (event.target === clicked && clicked.matches('select')) {
        clicked.blur();
      }
      clicked = null;
    });
  }

  // A file of what is seen

  async function savePicture() {
    const sheet = new OffscreenCanvas(...[stage.clientWidth, stage.clientHeight].map((length) =>
      Math.round(length * devicePixelRatio)));
    const pen = sheet.getContext('2d', { alpha: false });
    pen.scale(devicePixelRatio, devicePixelRatio);
    pen.imageSmoothingEnabled = !canvas.classList.contains('enlarged');
    pen.drawImage(canvas, canvas.offsetLeft, canvas.offsetTop, canvas.offsetWidth, canvas.offsetHeight);
    drawCross(pen);
    if (state.labels) {
      drawLabels(pen);
    }
    const link = document.createElement('a');
    link.href = URL.createObjectURL(await sheet.convertToBlob());
    link.download = `${[series.title, source.name].filter(Boolean).join('-')}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  }

  /** With a dark rim, as on the page. */
  function drawLine(pen, path, colour) {
    for (const [strokeStyle, lineWidth] of [['#000', 4], [colour, 1.5]]) {
      Object.assign(pen, { strokeStyle, lineWidth, lineJoin: 'round' }).stroke(new Path2D(path));
    }
  }

  function drawCross(pen) {
    const cross = element('cross');
    if (!cross.hasAttribute('hidden')) {
      pen.save();
      pen.translate(...['left', 'top'].map((side) => parseFloat(cross.style[side])));
      drawLine(pen, cross.lastElementChild.getAttribute('d'), getComputedStyle(cross.lastElementChild).stroke);
      pen.restore();
    }
  }

  function drawLabels(pen) {
    const { left, top } = stage.getBoundingClientRect();
    const bar = element('scale-bar').getBoundingClientRect();
    const colour = getComputedStyle(stage).color;
    drawLine(pen, `M${bar.left - left} ${bar.top - top}v${bar.height}h${bar.width}v${-bar.height}`, colour);
    Object.assign(pen, { fillStyle: colour, strokeStyle: '#000', lineWidth: 3, textAlign: 'center', textBaseline: 'middle' });
    for (const label of element('labels').querySelectorAll('span')) {
      const box = label.getBoundingClientRect();
      const { fontSize, fontFamily } = getComputedStyle(label);
      const text = [label.textContent, box.left - left + box.width / 2, box.top - top + box.height / 2];
      pen.font = `${fontSize} ${fontFamily}`;
      pen.strokeText(...text);
      pen.fillText(...text);
    }
  }

  // Start

  setTitle(series.title);
  [canvas.width, canvas.height] = [width, height];
  document.body.classList.toggle('coloured', isColoured);
  element('full-screen').hidden = !document.fullscreenEnabled;
  setDefaults();
  makePresets();
  showPlaying(false);
  showLabels();
  new ResizeObserver(place).observe(stage);
  placeAtEachResolution();
  listenToPointers();
  listenToControls();

  /** For tests: what is shown. */
  window.cine = Object.freeze(Object.defineProperties(source.tests, Object.getOwnPropertyDescriptors({
    get zoom() { return state.zoom; },
    get window() { return [state.low, state.high]; },
    get inverted() { return state.inverted; },
  })));
  return source.load();
}
