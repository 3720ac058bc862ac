import { MICROPHONE } from "../chunk";
import type { ReplaySegment } from "../moment";
import { levelOf } from "../../media/sound/sound_samples";
import { h, setText } from "../../ui/elements/dom";
import { decodeSound } from "../sound_decoder";

const WIDTH = 288;
const HEIGHT = 34;

/** The segment of sound that belongs to the event, as a wave, for each microphone. */
export class SoundCard {
  readonly element = h("section", "card sounds", { "aria-label": "Sound" }, h("h2", "", {}, "Sound"));
  readonly levels = new Map<string, number>(); // dB of full scale, by topic, of what is shown
  private readonly rows = new Map<string, { canvas: HTMLCanvasElement; words: HTMLElement }>();
  private turn = 0;

  constructor(topics: readonly string[], labels: ReadonlyMap<string, string>) {
    for (const topic of topics) {
      const canvas = h("canvas", "wave", {
        width: String(2 * WIDTH),
        height: String(2 * HEIGHT),
        "aria-hidden": "true",
      });
      const words = h("span", "card-note");
      const name = topic.slice(MICROPHONE.length);
      const line = h("div", "sound-line", {}, h("span", "stream-label", {}, labels.get(name) ?? name), words);
      this.element.append(line, canvas);
      this.rows.set(topic, { canvas, words });
    }
    this.element.hidden = topics.length === 0;
  }

  /** `damaged`: what is missing may be in a part that cannot be read. */
  async show(sounds: ReadonlyMap<string, ReplaySegment>, damaged: boolean): Promise<void> {
    const turn = ++this.turn;
    for (const [topic, { canvas, words }] of this.rows) {
      const segment = sounds.get(topic);
      const stamp = segment?.packets[0]?.event;
      if (segment === undefined || stamp === undefined) {
        setText(words, damaged ? "damaged" : "none yet");
        draw(canvas, new Float32Array(0));
        continue;
      }
      const decoded = await decodeSound(segment);
      if (turn !== this.turn) return; // another event is shown by now
      const length = `s ${stamp} · ${segment.packets.length} packet${segment.packets.length === 1 ? "" : "s"}`;
      if (decoded === null) {
        setText(words, `${length} · this browser cannot decode it`);
        draw(canvas, new Float32Array(0));
        continue;
      }
      const { samples } = decoded;
      const level = levelOf(samples);
      this.levels.set(topic, level);
      setText(words, `${length} · ${level === -Infinity ? "silent" : `${level.toFixed(0)} dB`}`);
      draw(canvas, samples);
    }
  }
}

function draw(canvas: HTMLCanvasElement, samples: Float32Array): void {
  const drawing = canvas.getContext("2d");
  if (drawing === null) return;
  const { width, height } = canvas;
  drawing.clearRect(0, 0, width, height);
  drawing.fillStyle = "#27313a";
  drawing.fillRect(0, height / 2 - 1, width, 2);
  drawing.fillStyle = "#7cbcff";
  const strongest = samples.reduce((most, sample) => Math.max(most, Math.abs(sample)), 0.05);
  for (let x = 0; x < width && samples.length > 0; x += 2) {
    const part = samples.subarray(
      Math.floor((x * samples.length) / width),
      Math.ceil(((x + 2) * samples.length) / width),
    );
    const low = part.reduce((least, sample) => Math.min(least, sample), 1) / strongest;
    const high = part.reduce((most, sample) => Math.max(most, sample), -1) / strongest;
    drawing.fillRect(x, (height / 2) * (1 - high), 2, Math.max(2, ((high - low) * height) / 2));
  }
}
