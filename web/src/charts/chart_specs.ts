import type { ChartStream, ChartWindow } from "./chart_ring";
import { streamColumn } from "./chart_ring";

/** One line of a chart: how it is told apart, and where its values come from. */
export interface ChartLine {
  readonly label: string;
  readonly stroke: string;
  readonly dash: readonly number[]; // empty: solid
  readonly width: number; // CSS pixels
  readonly values: (window: ChartWindow) => (number | null)[];
}

/** The band that a chart shades: between `-limit` and `limit`. */
export interface ChartBand {
  readonly label: string; // "pictures"
  readonly fill: string;
  readonly stroke: string;
  readonly limits: (window: ChartWindow) => (number | null)[];
}

export interface ChartSpec {
  readonly name: string; // "gap"
  readonly title: string;
  readonly unit: string; // "ms"; "" for counts
  readonly digits: number; // of the figures in the legend
  readonly fromZero: boolean; // the scale shows 0
  readonly lines: readonly ChartLine[];
  readonly bands: readonly ChartBand[];
}

/** Okabe and Ito's colours: told apart by everybody; dashes tell the lines apart without any. */
const WHITE = "#f4f7fa";
const SKY = "#56b4e9";
const ORANGE = "#f0a830";
const VIDEO_STROKES = [SKY, "#f0e442", "#cc79a7", "#8fd3b6"] as const;
const AUDIO_STROKES = [ORANGE, "#e8743b"] as const;
const VIDEO_DASHES = [[], [14, 5], [3, 5], [14, 5, 3, 5]] as const;
const AUDIO_DASHES = [
  [2, 4],
  [8, 3, 2, 3],
] as const;

/** The charts of a robot with these streams. */
export function chartSpecs(streams: readonly ChartStream[]): ChartSpec[] {
  return [
    {
      name: "event",
      title: "Event reference",
      unit: "",
      digits: 0,
      fromZero: false,
      lines: [plain("Feedback", WHITE, "event", 5), ...streamLines(streams, "stamp")],
      bands: [],
    },
    {
      name: "gap",
      title: "Gap",
      unit: "events · shaded: tolerance",
      digits: 0,
      fromZero: true,
      lines: streamLines(streams, "gap"),
      bands: bandsOf(streams),
    },
    {
      name: "delay",
      title: "Delay",
      unit: "ms",
      digits: 0,
      fromZero: true,
      lines: [
        plain("Command to picture", SKY, "picture_delay_ms", 3),
        { ...plain("Round trip", ORANGE, "round_trip_ms", 3), dash: [10, 5] },
      ],
      bands: [],
    },
    {
      name: "rate",
      title: "Event rate",
      unit: "/s",
      digits: 1,
      fromZero: true,
      lines: [plain("Events", WHITE, "event_rate", 3)],
      bands: [],
    },
  ];
}

function plain(label: string, stroke: string, column: string, width: number): ChartLine {
  return { label, stroke, dash: [], width, values: (window) => window.column(column) };
}

function streamLines(streams: readonly ChartStream[], column: "gap" | "stamp"): ChartLine[] {
  return [...streamsOf(streams, "video"), ...streamsOf(streams, "audio")].map(({ stream, at }) => {
    const isVideo = stream.kind === "video";
    const strokes = isVideo ? VIDEO_STROKES : AUDIO_STROKES;
    const dashes = isVideo ? VIDEO_DASHES : AUDIO_DASHES;
    return {
      label: stream.label,
      stroke: strokes[at % strokes.length] ?? SKY,
      dash: dashes[at % dashes.length] ?? [],
      width: 3,
      values: (window) => window.column(streamColumn(stream.name, column)),
    };
  });
}

/** One tolerance holds for all streams of a kind. */
function bandsOf(streams: readonly ChartStream[]): ChartBand[] {
  const video = streamsOf(streams, "video")[0]?.stream;
  const audio = streamsOf(streams, "audio")[0]?.stream;
  const band = (label: string, fill: string, stroke: string, stream: ChartStream): ChartBand => ({
    label,
    fill,
    stroke,
    limits: (window) => window.column(streamColumn(stream.name, "tolerance")),
  });
  return [
    ...(audio === undefined ? [] : [band("sound", "rgb(240 168 48 / 10%)", "rgb(240 168 48 / 70%)", audio)]),
    ...(video === undefined
      ? []
      : [band("pictures", "rgb(86 180 233 / 20%)", "rgb(86 180 233 / 80%)", video)]),
  ];
}

function streamsOf(
  streams: readonly ChartStream[],
  kind: ChartStream["kind"],
): { stream: ChartStream; at: number }[] {
  return streams.filter((stream) => stream.kind === kind).map((stream, at) => ({ stream, at }));
}
