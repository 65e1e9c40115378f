// What rendercanvas leaves to the application: two fingers, lines to copy, words about the connection.
{
  const View = window.BaseRenderView

  // Two fingers are a drag of the middle button and a wheel.
  const listenToTwoFingers = (view) => {
    const fingers = new Map()
    let before = null
    const measure = () => {
      const [first, second] = [...fingers.values()]
      return {
        x: (first.x + second.x) / 2,
        y: (first.y + second.y) / 2,
        distance: Math.max(1, Math.hypot(second.x - first.x, second.y - first.y))
      }
    }
    const send = (type, { x, y }, more) => view.onEvent({
      type, x, y, button: 3, buttons: [3], modifiers: [], ntouches: 0, touches: {}, timestamp: performance.now() / 1000, ...more
    })
    const listen = (type, react) => view.viewElement.addEventListener(type, (event) => {
      if (event.pointerType === 'touch') {
        react(event)
      }
    }, { capture: true, signal: view._abortController.signal })

    listen('pointerdown', (event) => {
      fingers.set(event.pointerId, { x: event.offsetX, y: event.offsetY })
      if (fingers.size > 1) {
        event.stopImmediatePropagation()
        event.preventDefault()
      }
      if (fingers.size === 2) {
        before = measure()
        send('pointer_down', before)
      }
    })
    listen('pointermove', (event) => {
      if (!fingers.has(event.pointerId)) {
        return
      }
      fingers.set(event.pointerId, { x: event.offsetX, y: event.offsetY })
      if (before === null) {
        return
      }
      event.stopImmediatePropagation()
      if (fingers.size === 2) {
        const now = measure()
        send('pointer_move', now)
        send('wheel', now, { dx: 0, dy: -300 * Math.log2(now.distance / before.distance) })
        before = now
      }
    })
    for (const type of ['pointerup', 'pointercancel']) {
      listen(type, (event) => {
        fingers.delete(event.pointerId)
        if (fingers.size === 0) {
          before = null
        }
      })
    }
  }

  // The newest picture is shown when it comes, or when the one before has loaded: rendercanvas waits for the browser's
  // next frame. A page that nobody sees goes on waiting, and with it the viewer.
  const showAtOnce = (owner, request, animate, find) => {
    const wait = owner[request]
    owner[request] = function () {
      const { frames, pictures } = find(this)
      const late = pictures.find((picture) => !picture.complete)
      if (document.hidden) {
        wait.call(this)
      } else if (late) {
        late.onload = late.onerror = this[request].bind(this)
      } else {
        frames.splice(0, frames.length - 1)
        this[animate]()
      }
    }
  }

  const registerEvents = View.prototype._registerEvents
  View.prototype._registerEvents = function () {
    listenToTwoFingers(this)
    registerEvents.call(this)
    if (this.requestAnimationFrame) {
      showAtOnce(this, 'requestAnimationFrame', 'animate', ({ frames, viewElement }) => ({
        frames, pictures: [viewElement]
      }))
    }
  }
  // browsers send moves once a frame; a throttled one would come after the end of its drag
  View.prototype.setThrottle = function () {
    this._moveThrottle = 0
  }

  const copy = async ({ type, text }) => {
    if (type !== 'copy') {
      return
    }
    try {
      await navigator.clipboard.writeText(text)
    } catch {
      window.prompt('', text)
    }
  }

  if (typeof RenderviewAnywidgetModel !== 'undefined') {
    // in a notebook
    showAtOnce(RenderviewAnywidgetModel.prototype, '_request_animation_frame', '_animate', ({ _frames, views }) => ({
      frames: _frames, pictures: views.map((view) => view.viewElement)
    }))
    const addView = RenderviewAnywidgetModel.prototype.addView
    RenderviewAnywidgetModel.prototype.addView = function (view) {
      if (this.views.length === 0) {
        this.anymodel.on('msg:custom', copy)
      }
      addView.call(this, view)
    }
  } else {
    // in a page of its own
    const status = document.getElementById('status')
    let socket = null
    new MutationObserver(() => {
      const text = status.textContent
      const note = document.getElementById('note')
      note.textContent = text.includes('passive')
        ? 'This picture is turned in another window. Close that one to turn it here.'
        : text.includes('Disconnected') ? 'The viewer has ended.' : ''
      note.hidden = note.textContent === ''
      if (window.websocket && window.websocket !== socket) {
        socket = window.websocket
        socket.addEventListener('message', ({ data }) => {
          if (typeof data === 'string') {
            copy(JSON.parse(data))
          }
        })
        document.querySelector('#rendercanvas-focus-element-container input').focus({ preventScroll: true })
      }
    }).observe(status, { childList: true, subtree: true })
  }
}
