import { COLUMNS, STREAM_COLUMNS, streamColumn, type ChartWindow } from "./chart_ring";

/** The rows as RFC 4180 text: a header, then one line a row; empty where nothing is known. */
export function chartCsv(window: ChartWindow): string {
  const streamNames = window.streams.flatMap((stream) =>
    STREAM_COLUMNS.map((column) => streamColumn(stream.name, column)),
  );
  const names = [...COLUMNS, ...streamNames];
  const epochs = window.epochs();
  const columns = names.map((name) => window.column(name));
  const lines = window.time.map((time, row) => [
    new Date(time * 1000).toISOString(),
    epochs[row] ?? "",
    ...columns.map((column) => figure(column[row] ?? null)),
  ]);
  return [["time", "epoch", ...names], ...lines].map((line) => line.map(field).join(",") + "\r\n").join("");
}

function figure(value: number | null): string {
  return value === null ? "" : String(Math.round(value * 1000) / 1000);
}

/** Quoted where needed; no spreadsheet takes a robot's word for a formula. */
function field(text: string): string {
  const safe = /^[=+@]/.test(text) ? `'${text}` : text;
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}
