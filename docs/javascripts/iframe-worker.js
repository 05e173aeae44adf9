// Browsers refuse workers in pages that are opened from a folder. The search then runs in a frame of the page instead.
if (location.protocol === "file:") {
  window.IFrameWorker = class extends EventTarget {
    constructor(address) {
      super()
      const own = new URL(address, location)
      this.frame = document.createElement("iframe")
      this.frame.hidden = true
      document.body.append(this.frame)
      const page = this.frame.contentDocument
      page.open()
      page.write("<!doctype html><title>search</title><body></body>")
      page.close()
      const inside = this.frame.contentWindow
      const load = source =>
        new Promise((done, failed) => {
          const script = page.createElement("script")
          script.src = new URL(source, own)
          script.onload = done
          script.onerror = failed
          page.body.append(script)
        })
      inside.importScripts = (...sources) => sources.reduce((before, one) => before.then(() => load(one)), Promise.resolve())
      inside.postMessage = data => this.dispatchEvent(new MessageEvent("message", { data: structuredClone(data) }))
      this.ready = load(own)
    }

    postMessage(data) {
      const inside = this.frame.contentWindow
      const copy = inside.structuredClone(data)
      this.ready.then(() => inside.dispatchEvent(new inside.MessageEvent("message", { data: copy })))
    }

    terminate() {
      this.frame.remove()
    }
  }
  window.Worker = window.IFrameWorker
}
