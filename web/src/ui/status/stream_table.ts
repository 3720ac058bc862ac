import { qualityLimitLabel, streamQualityLabel } from "../../media/quality_labels";
import type { ConsoleEngine } from "../../engine/console_engine";
import type { SoundStream } from "../../media/sound/sound_stream";
import type { VideoStream } from "../../media/video_stream";
import { grouped, h, setData, setHidden, setText, type Panel } from "../elements/dom";

interface Row {
  readonly element: HTMLElement;
  show(stream: VideoStream | SoundStream, tolerance: number, quality: string): void;
}

/** Every stream's gap against its tolerance, and what the gate did with it. */
export function createStreamTable(engine: ConsoleEngine): Panel {
  const rows = new Map<string, Row>();
  const empty = h("p", "muted", {}, "No streams");
  const body = h("div", "streams");
  const carrier = h("span", "card-note");
  const head = h("div", "card-head", {}, h("h2", "", {}, "Streams"), carrier);
  const limit = h("p", "quality-limit");
  return {
    element: h("section", "card", { "aria-label": "Streams" }, head, limit, empty, body),
    update() {
      const streams = [...engine.streams.videos.values(), ...engine.streams.sounds.values()];
      setHidden(empty, streams.length > 0);
      const words = qualityLimitLabel(engine.state.quality);
      setHidden(limit, words === null);
      setText(limit, words ?? "");
      setText(carrier, [...new Set(streams.map((stream) => stream.info.carrier))].join(", "));
      keepRows(rows, body, new Set(streams.map((stream) => stream.info.stream)));
      for (const stream of streams) {
        const row = rows.get(stream.info.stream) ?? addRow(rows, body, stream.info.stream);
        const quality = engine.state.quality?.streams.find((found) => found.stream === stream.info.stream);
        row.show(
          stream,
          engine.state.settings.tolerance[stream.info.kind],
          quality === undefined ? "" : streamQualityLabel(quality),
        );
      }
    },
  };
}

function keepRows(rows: Map<string, Row>, body: HTMLElement, names: ReadonlySet<string>): void {
  for (const [name, row] of rows) {
    if (names.has(name)) continue;
    body.removeChild(row.element);
    rows.delete(name);
  }
}

function addRow(rows: Map<string, Row>, body: HTMLElement, name: string): Row {
  const row = createRow();
  rows.set(name, row);
  body.append(row.element);
  return row;
}

function createRow(): Row {
  const label = h("span", "stream-label");
  const codec = h("span", "stream-codec");
  const gap = h("span", "stream-gap");
  const bar = h("span", "gap-bar", { "aria-hidden": "true" }, h("span", "gap-fill"));
  const picture = h("span", "stream-quality");
  const counts = h("span", "stream-counts");
  const element = h("div", "stream", {}, label, codec, bar, gap, picture, counts);
  return {
    element,
    show(stream, tolerance, quality) {
      const { counts: found } = stream.gate;
      const discarded = "discarded" in stream ? stream.discarded() : found.discarded;
      const size = Math.abs(found.gap ?? 0);
      setText(label, stream.info.label);
      setText(codec, stream.info.codec);
      setText(picture, quality);
      setHidden(picture, quality === "");
      const isStarting = "isStarting" in stream && stream.isStarting();
      setText(gap, isStarting ? "starting" : found.gap === null ? "–" : `${found.gap} of ${tolerance}`);
      bar.style.setProperty(
        "--share",
        (tolerance === 0 ? Number(size > 0) : Math.min(1, size / tolerance)).toFixed(2),
      );
      setData(bar, "tone", size > tolerance ? "bad" : size > tolerance / 2 ? "wait" : "good");
      setText(
        counts,
        `${grouped(found.rendered)} shown · ${grouped(discarded)} discarded · ${grouped(found.held)} held`,
      );
    },
  };
}
