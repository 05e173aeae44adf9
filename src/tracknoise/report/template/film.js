const filmed = JSON.parse(document.getElementById("filmed").textContent);
const TRAIL = 8;
const WIDTH = 640;
const MARK = 5;

/** Show frames of a scene with tracks: a line behind each feature, a cross where it was observed, a circle where it was. */
class Film {
  constructor(place) {
    this.canvas = place.querySelector("canvas");
    this.form = place.querySelector("form");
    const kind = filmed.frames[0].startsWith("/9j/") ? "jpeg" : "webp";
    this.images = filmed.frames.map((data) => Object.assign(new Image(), { src: `data:image/${kind};base64,${data}` }));
    this.timer = null;
    this.form.addEventListener("input", () => this.show());
    this.form.addEventListener("submit", (event) => event.preventDefault());
    this.form.play.addEventListener("click", () => this.play());
    this.show();
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) {
      this.play();
    }
  }

  /** Play the frames, or stop. */
  play() {
    if (this.timer) {
      clearInterval(this.timer);
      this.timer = null;
    } else {
      this.timer = setInterval(() => {
        this.form.frame.value = (Number(this.form.frame.value) + 1) % filmed.frames.length;
        this.show();
      }, 250);
    }
    this.form.play.textContent = this.timer ? "Stop" : "Play";
  }

  async show() {
    const frame = Number(this.form.frame.value);
    const image = this.images[frame];
    await image.decode();
    if (frame !== Number(this.form.frame.value)) {
      return;
    }
    const scale = Math.max(1, WIDTH / filmed.width);
    this.canvas.width = Math.round(filmed.width * scale);
    this.canvas.height = Math.round(filmed.height * scale);
    const context = this.canvas.getContext("2d");
    context.drawImage(image, 0, 0, this.canvas.width, this.canvas.height);
    const tracks = filmed.trackers[this.form.tracker.value];
    const colour = explored.colours[this.form.tracker.value];
    const shown = tracks.filter((track) => Number.isFinite(track.u[frame - track.frame]));
    shown.forEach((track) => this.track(context, track, frame - track.frame, scale, colour));
    this.canvas.parentElement.querySelector("output").textContent = `${shown.length} tracks.`;
    this.canvas.dataset.shown = `${this.form.tracker.value} ${frame}`;
  }

  /** One track up to a frame. Pixel centres are whole numbers. */
  track(context, track, at, scale, colour) {
    const place = (values, now) => (values[now] + 0.5) * scale;
    const times = Number(this.form.magnified.value);
    context.lineWidth = 1.5;
    context.strokeStyle = colour;
    context.beginPath();
    for (let now = Math.max(0, at - TRAIL); now <= at; now += 1) {
      if (track.u[now] !== null) {
        context.lineTo(place(track.u, now), place(track.v, now));
      }
    }
    context.stroke();
    const [x, y] = [place(track.u, at), place(track.v, at)];
    for (const [width, ink] of [[3.5, "#000000"], [1.5, "#ffffff"]]) {
      context.lineWidth = width;
      context.strokeStyle = ink;
      context.beginPath();
      context.moveTo(x - MARK, y);
      context.lineTo(x + MARK, y);
      context.moveTo(x, y - MARK);
      context.lineTo(x, y + MARK);
      context.stroke();
    }
    if (track.du[at] !== null) {
      const [trueX, trueY] = [x - times * scale * track.du[at], y - times * scale * track.dv[at]];
      context.strokeStyle = colour;
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(trueX, trueY);
      context.stroke();
      context.beginPath();
      context.arc(trueX, trueY, MARK, 0, 2 * Math.PI);
      context.stroke();
    }
  }
}

const filmPlace = document.getElementById("film");
if (filmPlace) {
  new IntersectionObserver((entries, observer) => {
    if (entries.some((entry) => entry.isIntersecting)) {
      observer.disconnect();
      window.film = new Film(filmPlace);
    }
  }, { rootMargin: "400px" }).observe(filmPlace);
}
