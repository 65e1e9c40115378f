// ---- Views: the directions u (right), v (down) and w (away) in the patient (LPS)

const sides = {
  anterior: { u: [1, 0, 0], v: [0, 0, -1], w: [0, 1, 0] },
  posterior: { u: [-1, 0, 0], v: [0, 0, -1], w: [0, -1, 0] },
  left: { u: [0, 1, 0], v: [0, 0, -1], w: [-1, 0, 0] },
  right: { u: [0, -1, 0], v: [0, 0, -1], w: [1, 0, 0] },
  superior: { u: [-1, 0, 0], v: [0, 1, 0], w: [0, 0, -1] },
  inferior: { u: [1, 0, 0], v: [0, 1, 0], w: [0, 0, 1] },
};

const longAxis = [0, 0, 1];

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const combine = (a, s, b, t) => a.map((each, n) => each * s + b[n] * t);
const subtract = (a, b) => combine(a, 1, b, -1);
const normalize = (a) => a.map((each) => each / Math.hypot(...a));
const normalizeView = ({ u, v, w }) => ({ u: normalize(u), v: normalize(v), w: normalize(w) });
const toDegrees = (radians) => radians * 180 / Math.PI;

/** Cosine and sine of an angle in degrees. Of multiples of 90 they are exact. */
function turnUnit(degrees) {
  const quarters = Math.round(degrees / 90);
  const rest = (degrees - 90 * quarters) * Math.PI / 180;
  const cosines = [Math.cos(rest), -Math.sin(rest), -Math.cos(rest), Math.sin(rest)];
  const quadrant = modulo(quarters, 4);
  return [cosines[quadrant], cosines[(quadrant + 3) % 4]];
}

/** Seen from the front, and then moved by degrees to the patient's left and towards the head. */
function makeView(azimuth, elevation) {
  const [cosine, sine] = turnUnit(azimuth);
  const [cosineUp, sineUp] = turnUnit(-elevation);
  const { u, v, w } = sides.anterior;
  const away = combine(w, cosine, u, -sine);
  return { u: combine(u, cosine, w, sine), v: combine(v, cosineUp, away, sineUp), w: combine(away, cosineUp, v, -sineUp) };
}

/** With angles that can be written down. */
const makeRoundView = (...angles) => makeView(...angles.map((angle) => Number(angle.toFixed(3))));

function rotate(view, axis, degrees) {
  const [cosine, sine] = turnUnit(degrees);
  const turn = (a) => combine(combine(a, cosine, cross(axis, a), sine), 1, axis, dot(axis, a) * (1 - cosine));
  return { u: turn(view.u), v: turn(view.v), w: turn(view.w) };
}

const isSame = (one, other, tolerance) =>
  ['u', 'v', 'w'].every((name) => subtract(one[name], other[name]).every((each) => Math.abs(each) <= tolerance));

const findSide = (view, tolerance) => Object.keys(sides).find((side) => isSame(view, sides[side], tolerance));

/** 1, or -1 of a mirrored view. */
const findHand = ({ u, v, w }) => Math.sign(dot(cross(u, v), w));

const unmirror = (view) => ({ ...view, u: view.u.map((each) => each * findHand(view)) });

/** Azimuth and elevation from anterior, and the roll of the picture before it is mirrored, clockwise; in degrees, more
 * than -180 and at most 180. */
function findAngles(view) {
  const { u, w } = normalizeView(unmirror(view));
  // seen along the long axis, what is up says where the front is
  const azimuth = Math.hypot(w[0], w[1]) < 1e-6 ? Math.atan2(u[1], u[0]) : Math.atan2(-w[0], w[1]);
  const level = [Math.cos(azimuth), Math.sin(azimuth), 0];
  const roll = Math.atan2(dot(u, cross(w, level)), dot(u, level));
  return [azimuth, Math.asin(clamp(-w[2], -1, 1)), roll].map((angle) => Number(toDegrees(angle).toFixed(6)) + 0)
    .map((angle) => (angle > -180 ? angle : 180));
}

/** The side of the patient to which a direction points, or two sides, the nearer first. */
function findLetters(direction) {
  // rounding errors make no letter
  const lengths = normalize(direction).map((each) => Number(Math.abs(each).toFixed(6)));
  return [0, 1, 2].sort((first, second) => lengths[second] - lengths[first]).slice(0, 2)
    .filter((axis) => lengths[axis] >= 0.382683)
    .map((axis) => ['LR', 'PA', 'HF'][axis][Number(direction[axis] < 0)]).join('');
}

/** Solves a * x + b * y + c * z = d. */
function solve([a, b, c], d) {
  const determinant = dot(a, cross(b, c));
  return [dot(d, cross(b, c)), dot(d, cross(c, a)), dot(d, cross(a, b))].map((each) => each / determinant);
}

const columnsOf = (rows) => [0, 1, 2, 3].map((column) => rows.map((row) => row[column]));

// ---- What a browser may lack

/** A function with one operation on 128 bits. */
const simd = [0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15, 253, 98, 11];

function verifyBrowser() {
  if (!globalThis.WebAssembly?.validate(new Uint8Array(simd))) {
    throw new Error('This browser is too old for this page: it has no WebAssembly with SIMD. Use one of 2023 or later.');
  }
}

// ---- A volume, which the engine projects

const modes = ['maximum', 'minimum', 'mean'];
const titleOf = (mode) => `${mode[0].toUpperCase()}${mode.slice(1)} intensity projection`;

function makeVolume(series, viewer) {
  verifyBrowser();
  const { volume } = series;
  const { size: count, center } = volume;
  const [i, j, k, start] = columnsOf(volume.toPhysical);
  const [u, v, w, middle] = columnsOf(volume.view);
  // views have the center of the volume in their middle
  const depth = solve([u, v, w], subtract(center, middle))[2];
  const first = {
    view: { u, v, w },
    mode: volume.mode,
    slab: volume.slab?.map((each) => each - depth) ?? null,
    exact: volume.exact,
  };

  // mm of the view, in which a first view with a scale has more than the patient
  const scales = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => solve([u, v, w], axis));
  const stretch = Math.max(1, ...[0, 1].map((axis) => Math.hypot(...scales.map((each) => each[axis]))));
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => {
    const [x, y, z] = count.map((length, axis) => ((corner >> axis & 1) * length) - 0.5);
    return [0, 1, 2].map((n) => (i[n] * x + j[n] * y + k[n] * z + start[n] - center[n]) * stretch);
  });
  const radius = Math.max(...corners.map((corner) => Math.hypot(...corner)));
  const spans = [0, 1, 2].map((axis) => Math.max(...corners.map((corner) => Math.abs(corner[axis]))));
  const across = Math.max(...corners.map(([x, y]) => Math.hypot(x, y)));
  const voxel = Math.min(...[i, j, k].map((axis) => Math.hypot(...axis)));
  const precision = Math.min(voxel, 0.1);
  const decimals = clamp(Math.ceil(3 - Math.log10(voxel)), 4, 20);
  // browsers have no memory for the pictures of a volume whose voxels are very long
  const resolution = Math.max(volume.spacing, 2 * radius / 4096);
  // a thinner slab can lie between the voxels of half the resolution
  const thinnestCoarse = 4 * stretch * Math.max(...[i, j, k].map((axis) => Math.hypot(...axis)));

  /** Pixels along a direction of the first view, as many as put them on voxels and not between them. */
  const countPixels = (direction) => {
    const measure = (axis) => Math.abs(dot(normalize(axis), direction));
    const [along] = [i, j, k].sort((one, other) => measure(other) - measure(one));
    const offset = modulo(dot(subtract(center, start), along) / dot(along, along), 1);
    return 2 * Math.ceil(radius / resolution) + Number(Math.abs(offset - 0.5) > 0.25);
  };
  const [width, height] = [countPixels(normalize(u)), countPixels(normalize(v))];
  const origin = [width, height].map((length) => -(length - 1) / 2 * resolution);
  const makePicture = (firstRow, rows) =>
    [width, rows, resolution, resolution, origin[0], origin[1] + firstRow * resolution];
  const picture = makePicture(0, height);
  const bandRows = Math.ceil(height / 10);

  let wanted = first;
  let shown = null;
  let partial = null;
  let inFlight = null;
  let clicked = null;
  let asked = null;
  let point = null;
  let isAtRest = false;
  let isTrackball = false;
  let isSlow = false;
  let hasCoarse = false;
  let rest = 0;
  let player = 0;
  let playing = null;
  let windows = {};
  let windowed = null;

  // The worker, which has one request at a time

  const worker = new Worker(URL.createObjectURL(new Blob([decodeBase64, element('worker').textContent])));
  let fail = null;
  // from here on, pictures in motion have half the resolution
  const slowMilliseconds = 40;
  // the first two views along each axis of the volume take longer
  const warmUps = [sides.superior, sides.left, sides.anterior].flatMap((view) => [view, view]);

  function ask(request, react) {
    inFlight = react;
    worker.postMessage(request);
  }

  worker.onmessage = ({ data }) => {
    if (data.problem) {
      end(data.problem);
    } else if (data.fraction) {
      element('loading').value = data.fraction;
    } else {
      const react = inFlight;
      inFlight = null;
      react(data);
    }
  };
  worker.onerror = worker.onmessageerror = () =>
    end('The volume cannot be shown: the browser has ended its engine, perhaps for want of memory.');

  function end(problem) {
    stop();
    worker.terminate();
    fail(new Error(problem));
  }

  const isExact = ({ exact, mode }) => exact && mode !== 'mean';
  const mayBeCoarse = ({ mode, slab }) => mode === 'maximum' && (!slab || slab[1] - slab[0] >= thinnestCoarse);

  const makeRequest = (state, more) => ({
    view: [0, 1, 2].flatMap((n) => [state.view.u[n], state.view.v[n], state.view.w[n], center[n]]),
    picture,
    mode: modes.indexOf(state.mode),
    slab: state.slab ?? [-Infinity, Infinity],
    isExact: false,
    isCoarse: false,
    hasDepth: false,
    ...more,
  });

  /** Asks for the next picture, if one is due. */
  function pump() {
    if (inFlight) {
      return;
    }
    if (clicked) {
      const { state, request } = clicked;
      clicked = null;
      ask(request, (answer) => setPoint(state, request, answer));
    } else if (shown?.state !== wanted || (isAtRest && shown.isCoarse)) {
      project(wanted, hasCoarse && isSlow && !isAtRest && mayBeCoarse(wanted));
    } else if (isAtRest && isExact(wanted) && !shown.isExact) {
      projectExactly(wanted);
    } else if (warmUps.length > 0) {
      ask(makeRequest({ ...first, view: warmUps.pop() }), ({ milliseconds }) => {
        isSlow = milliseconds > slowMilliseconds;
        pump();
      });
    } else if (isSlow && !hasCoarse) {
      hasCoarse = true;
      ask(makeRequest(first, { isCoarse: true }), pump);
    }
  }

  function project(state, isCoarse) {
    const request = makeRequest(state, { isCoarse });
    ask(request, ({ values, milliseconds }) => {
      isSlow = isCoarse ? isSlow : milliseconds > slowMilliseconds;
      show({ state, isExact: false, isCoarse, values, view: request.view, milliseconds });
    });
  }

  /** Some rows at a time, so that a movement need not wait for all. */
  function projectExactly(state) {
    if (partial?.state !== state) {
      partial = { ...shown, isExact: true, values: shown.values.slice(), row: 0 };
    }
    const rows = Math.min(bandRows, height - partial.row);
    ask(makeRequest(state, { picture: makePicture(partial.row, rows), isExact: true }), ({ values }) => {
      partial.values.set(values, partial.row * width);
      partial.row += rows;
      if (partial.row === height) {
        show(partial);
      } else {
        pump();
      }
    });
  }

  function show(result) {
    shown = result;
    partial = null;
    pump();
    takeWindow();
    viewer.draw();
    showPoint();
  }

  function change(changes) {
    wanted = { ...wanted, ...changes };
    say('');
    isAtRest = false;
    clearTimeout(rest);
    rest = setTimeout(() => {
      isAtRest = true;
      pump();
      element('spoken').textContent = speakState(wanted);
    }, 120);
    pump();
  }

  // Windows: each mode has its own

  function takeWindow() {
    const { mode } = shown.state;
    if (mode !== windowed) {
      windows[windowed] = { ...windows[windowed], window: viewer.window };
      windowed = mode;
      windows[mode] ??= makeWindow(findWindow(shown.values));
      viewer.useWindow(windows[mode].window, windows[mode].automatic);
    }
  }

  const makeWindow = (window) => ({ window, automatic: window });

  function resetWindows() {
    windows = { [first.mode]: makeWindow(series.window) };
    windowed = first.mode;
  }

  /** Percentiles 1 and 99.8 of the values that are not background. */
  function findWindow(values) {
    const counts = new Uint32Array(2 ** series.bits);
    for (const stored of values) {
      ++counts[stored];
    }
    counts[series.background] = 0;
    counts[volume.backgroundVoxel] = 0;
    const total = counts.reduce((sum, count) => sum + count, 0);
    const [low, high] = [0.01, 0.998].map((fraction) => {
      let before = Math.round(fraction * (total - 1));
      return counts.findIndex((each) => (before -= each) < 0);
    }).map((stored) => viewer.toValue(stored));
    return total > 0 ? [low < high ? low : high - 1, high] : series.window;
  }

  // Text

  // angles that are written as 0
  const nearestSide = (view) => findSide(normalizeView(view), 9e-4);

  const describeView = (view) => {
    const side = nearestSide(unmirror(view));
    const [azimuth, elevation, roll] = findAngles(view);
    const angles = [
      [azimuth > 0 ? 'LAO ' : 'RAO ', Math.abs(azimuth)],
      [elevation > 0 ? 'CRA ' : 'CAU ', Math.abs(elevation)],
      ['roll ', roll],
    ].filter(([, angle]) => Math.abs(angle) >= 0.05).map(([name, angle]) => name + formatDegrees(angle));
    const names = side ? [side[0].toUpperCase() + side.slice(1)] : angles;
    return [...names, ...(findHand(view) < 0 ? ['mirrored'] : [])].join(' ');
  };

  const describeMode = (mode) => (mode === 'maximum' ? '' : mode[0].toUpperCase() + mode.slice(1));

  function describeSlab(slab) {
    const [thickness, position] = measureSlab(slab).map((each) => format(each, precision));
    return `Slab ${thickness} mm at ${position} mm`;
  }

  const speakState = ({ view, mode, slab }) =>
    [describeView(view), describeMode(mode), slab ? describeSlab(slab) : ''].filter(Boolean).join(', ');

  function describe() {
    const { state: { view, mode, slab }, isExact } = shown;
    element('view-name').textContent = describeView(view);
    element('mode-name').textContent = [describeMode(mode), isExact ? 'exact' : ''].filter(Boolean).join(', ');
    element('slab-name').textContent = slab ? describeSlab(slab) : '';
    element('view').value = nearestSide(view) ?? '';
    const edges = [view.u.map((each) => -each), view.u, view.v.map((each) => -each), view.v];
    return {
      spoken: speakState(shown.state),
      letters: volume.hasOrientation ? edges.map(findLetters) : null,
    };
  }

  function say(message) {
    element('message').textContent = message;
  }

  function showState() {
    element('mode').value = wanted.mode;
    if (modes.map(titleOf).includes(series.title)) {
      viewer.setTitle(titleOf(wanted.mode));
    }
    element('exact').checked = wanted.exact;
    element('slab').checked = wanted.slab !== null;
    element('slab-problem').hidden = true;
    const values = wanted.slab ? measureSlab(wanted.slab) : ['', ''];
    ['thickness', 'position'].forEach((name, n) => {
      for (const id of [`slab-${name}`, `slab-${name}-slider`]) {
        element(id).disabled = !wanted.slab;
        element(id).value = wanted.slab ? Number(values[n].toFixed(decimals)) : '';
      }
    });
  }

  // Turning

  const turnTo = (view) => change({ view });
  const stopAndTurn = (view) => {
    stop();
    turnTo(view);
  };

  /** Turns the volume: its front moves by degrees to the right and down. */
  function turn(view, right, down) {
    const [toRight, toBottom] = [normalize(view.u), normalize(view.v)];
    const hand = findHand(view);
    if (isTrackball) {
      const degrees = hand * Math.hypot(right, down);
      return degrees ? rotate(view, normalize(combine(toBottom, right, toRight, -down)), degrees) : view;
    }
    const [azimuth, elevation] = findAngles(view);
    const tilted = clamp(elevation + down, -90, 90);
    if (isSame(view, makeView(azimuth, elevation), 1e-6)) {
      return makeRoundView(azimuth - right, tilted);
    }
    const turned = rotate(view, longAxis, -hand * right);
    return rotate(turned, normalize(turned.u), hand * (elevation - tilted));
  }

  const turnBy = (right, down) => stopAndTurn(turn(wanted.view, right, down));

  const drag = {
    begin: () => stop(),
    move(right, down) {
      if (right || down) {
        const degrees = 180 / Math.min(viewer.stage.clientWidth, viewer.stage.clientHeight);
        turnTo(turn(wanted.view, degrees * right, degrees * down));
      }
    },
  };

  function toggleTrackball() {
    isTrackball = !isTrackball;
    say(isTrackball ? 'Turning as a trackball' : 'Turning about the long axis');
  }

  const turnMilliseconds = 8000;

  function togglePlaying() {
    if (playing !== null) {
      stop();
      return;
    }
    const { view } = wanted;
    const [azimuth, elevation] = findAngles(view);
    const isNamed = isSame(view, makeView(azimuth, elevation), 1e-6);
    playing = performance.now();
    const tick = (now) => {
      const degrees = 360 * Math.max(now - playing, 0) / turnMilliseconds;
      turnTo(isNamed ? makeRoundView(azimuth + degrees, elevation) : rotate(view, longAxis, degrees));
      player = requestAnimationFrame(tick);
    };
    player = requestAnimationFrame(tick);
    viewer.showPlaying(true);
  }

  function stop() {
    cancelAnimationFrame(player);
    playing = null;
    viewer.showPlaying(false);
  }

  // Mode and slab

  function setMode(mode) {
    change({ mode });
    showState();
  }

  function setExact(isOn) {
    change({ exact: isOn });
    showState();
    say(isOn ? 'Exact at rest' : '');
  }

  const measureSlab = ([near, far]) => [far - near, (near + far) / 2];

  function setSlab(thickness, position) {
    const half = Math.max(thickness, voxel) / 2;
    const at = clamp(position, -radius, radius);
    change({ slab: half < radius ? [at - half, at + half] : null });
    showState();
  }

  function toggleSlab() {
    if (wanted.slab) {
      change({ slab: null });
      showState();
    } else {
      setSlab(roundLength(radius / 2), 0);
    }
  }

  function resizeSlab(factor) {
    if (wanted.slab) {
      const [thickness, position] = measureSlab(wanted.slab);
      setSlab(thickness * factor, position);
    } else if (factor < 1) {
      toggleSlab();
    }
  }

  function moveSlab(quarters) {
    if (!wanted.slab) {
      say('There is no slab: press , for one');
      return;
    }
    const [thickness, position] = measureSlab(wanted.slab);
    setSlab(thickness, position + quarters * thickness / 4);
  }

  function typeSlab() {
    const [thickness, position] = ['thickness', 'position'].map((name) => element(`slab-${name}`).valueAsNumber);
    if (thickness > 0 && Number.isFinite(position)) {
      setSlab(thickness, position);
    } else {
      element('slab-problem').hidden = false;
    }
  }

  function slideSlab() {
    setSlab(...['thickness', 'position'].map((name) => element(`slab-${name}-slider`).valueAsNumber));
  }

  function wheel(notches) {
    if (wanted.slab) {
      moveSlab(notches);
    }
    return wanted.slab !== null;
  }

  // Points

  function click(column, row) {
    if (!shown) {
      return;
    }
    if (shown.state.mode === 'mean') {
      say('A mean has no point');
      return;
    }
    const place = [origin[0] + column * resolution, origin[1] + row * resolution];
    const { state, isExact } = shown;
    asked = makeRequest(state, { picture: [1, 1, 1, 1, ...place], isExact, hasDepth: true });
    clicked = { state, request: asked };
    pump();
  }

  function setPoint({ view }, request, { values, depths }) {
    pump();
    if (request !== asked) {
      return;
    }
    const [x, y, z] = [...request.picture.slice(4), depths[0]];
    const position = [0, 1, 2].map((n) => view.u[n] * x + view.v[n] * y + view.w[n] * z + center[n]);
    point = Number.isNaN(z) ? null : { position, value: viewer.describeValue(values[0]), ...findIndex(position) };
    showPoint();
    if (!point) {
      say('There is nothing at this point');
    }
  }

  /** The nearest voxel, of the whole volume if its place is known. */
  function findIndex(position) {
    const { whole } = volume;
    const [a, b, c, from] = columnsOf(whole.toPhysical ?? volume.toPhysical);
    const size = whole.toPhysical ? whole.size : count;
    const index = solve([a, b, c], subtract(position, from))
      .map((each, axis) => clamp(Math.round(each), 0, size[axis] - 1));
    const isReduced = !whole.toPhysical && whole.size.some((length, axis) => length !== count[axis]);
    return { index, isReduced };
  }

  function removePoint() {
    point = null;
    showPoint();
  }

  function showPoint() {
    element('point').hidden = !point;
    element('cross').toggleAttribute('hidden', !point);
    if (!point) {
      return;
    }
    const { position, index, isReduced, value } = point;
    element('point-value').textContent = value;
    element('point-position').textContent = `${position.map((each, axis) => (volume.hasOrientation
      ? `${['LR', 'PA', 'HF'][axis][Number(each < 0)]} ${format(Math.abs(each), precision)}`
      : `${'xyz'[axis]} ${format(each, precision)}`)).join('  ')} mm`;
    element('point-index').textContent = `voxel ${index.join(', ')}${isReduced ? ' of the reduced volume' : ''}`;
    place();
  }

  /** The cross stays at the point. */
  function place() {
    if (!point || !shown) {
      return;
    }
    const { view } = shown.state;
    const at = solve([view.u, view.v, view.w], subtract(point.position, center));
    const canvas = element('picture');
    const [left, top] = [
      [canvas.offsetLeft, canvas.offsetWidth / width], [canvas.offsetTop, canvas.offsetHeight / height],
    ].map(([begin, scale], axis) => begin + ((at[axis] - origin[axis]) / resolution + 0.5) * scale);
    Object.assign(element('cross').style, { left: `${left}px`, top: `${top}px` });
  }

  // The command that makes this picture

  const quote = (word) => (/^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);

  /** Options for a view; null if they cannot say it. */
  function nameView(view) {
    const side = findSide(view, 1e-12);
    if (side) {
      return ['--view', side];
    }
    const [azimuth, elevation] = findAngles(view);
    const angles = [['--azimuth', azimuth], ['--elevation', elevation]].filter(([, angle]) => angle !== 0);
    return isSame(view, makeView(azimuth, elevation), 1e-12) ? angles.flat() : null;
  }

  async function copyCommand() {
    const { view, mode, slab } = wanted;
    const ofView = nameView(view);
    if (!ofView) {
      say('No command alone makes this view: it needs a file of the transform');
      return;
    }
    const [program, input, ...options] = volume.command;
    const ofMode = mode === windowed ? viewer.window : windows[mode]?.window;
    const line = [
      program, input, 'mip.png', ...options, ...ofView,
      ...(mode === 'maximum' ? [] : ['--mode', mode]),
      ...(slab ? ['--slab', ...slab] : []),
      ...(isExact(wanted) ? ['--exact'] : []),
      '--size', width, height, '--output-spacing', resolution,
      ...(ofMode ? ['--window', ...ofMode] : []),
    ].map((word) => quote(String(word))).join(' ');
    try {
      await navigator.clipboard.writeText(line);
      say('The command is copied');
    } catch {
      window.prompt('The command that makes this picture:', line);
    }
  }

  function reset() {
    const wasPlaying = playing !== null;
    stop();
    clicked = asked = null;
    removePoint();
    isTrackball = false;
    resetWindows();
    change(first);
    showState();
    if (wasPlaying) {
      togglePlaying();
    }
  }

  const keys = {
    ' ': togglePlaying,
    ArrowLeft: () => turnBy(-5, 0),
    ArrowRight: () => turnBy(5, 0),
    ArrowUp: () => turnBy(0, -5),
    ArrowDown: () => turnBy(0, 5),
    ...Object.fromEntries(Object.values(sides).map((view, n) => [n + 1, () => stopAndTurn(view)])),
    t: toggleTrackball,
    m: () => setMode(modes[(modes.indexOf(wanted.mode) + 1) % modes.length]),
    e: () => setExact(!wanted.exact),
    ',': () => resizeSlab(0.8),
    '<': () => resizeSlab(0.8),
    '.': () => resizeSlab(1.25),
    '>': () => resizeSlab(1.25),
    '[': () => moveSlab(-1),
    ']': () => moveSlab(1),
    c: copyCommand,
    Escape: removePoint,
  };

  const inputs = {
    view: ({ value }) => stopAndTurn(sides[value]),
    mode: ({ value }) => setMode(value),
    exact: ({ checked }) => setExact(checked),
    slab: toggleSlab,
    'slab-thickness': typeSlab,
    'slab-position': typeSlab,
    'slab-thickness-slider': slideSlab,
    'slab-position-slider': slideSlab,
  };

  // Start

  function load() {
    const loading = element('loading');
    Object.assign(element('slab-thickness-slider'), { min: voxel, max: 2 * radius });
    Object.assign(element('slab-position-slider'), { min: -radius, max: radius });
    showState();
    element('view').value = nearestSide(wanted.view) ?? '';
    say('Loading the volume …');
    resetWindows();
    const { whole } = volume;
    const isReduced = whole.size.some((length, axis) => length > count[axis]);
    element('about').textContent = `This page holds ${count.join(' × ')} voxels`
      + `${isReduced ? ` of ${whole.size.join(' × ')}` : ''}, whose values are rounded to steps of ${Number(Math.abs(series.slope).toPrecision(3))}. `
      + 'It loads nothing and sends nothing. It is not for diagnosis.';
    // the engine can also fail later
    return new Promise((_, reject) => {
      fail = reject;
      const [engine, voxels] = ['engine', 'voxels'].map((id) => element(id)?.textContent ?? '');
      element('voxels')?.remove();
      ask({ engine, voxels, bits: series.bits, size: count, toPhysical: volume.toPhysical.flat() }, ({ range }) => {
        loading.hidden = true;
        viewer.setRange(...range.map(viewer.toValue));
        change({});
      });
    });
  }

  const tests = {
    get shown() { return shown !== null; },
    get view() { return shown.view; },
    get picture() { return picture; },
    get values() { return shown.values; },
    get state() { return shown.state; },
    get isExact() { return shown.isExact; },
    get isCoarse() { return shown.isCoarse; },
    get milliseconds() { return shown.milliseconds; },
    get point() { return point; },
    get playing() { return playing !== null; },
    get settled() {
      const isDone = !inFlight && !clicked && shown?.state === wanted && !shown.isCoarse;
      return isDone && (!isExact(wanted) || shown.isExact);
    },
  };

  return {
    width,
    height,
    spacing: [resolution, resolution],
    origin,
    extent: [2 * across, 2 * Math.max(...spans)].map((length) => length / 0.94),
    get values() { return shown?.values ?? null; },
    get name() { return describeView(wanted.view).toLowerCase().replaceAll(' ', '-').replaceAll('°', ''); },
    describe,
    drag,
    wheel,
    click,
    place,
    reset,
    keys,
    buttons: { play: togglePlaying },
    inputs,
    tests,
    load,
  };
}
