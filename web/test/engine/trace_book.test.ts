import { describe, expect, it } from "vitest";
import { TraceBook, slowestEvents } from "../../src/engine/trace_book";
import type { CommandSpans, PictureSpans, Traces } from "../../src/protocol/wire";

const COMMAND: CommandSpans = {
  forward_ms: 1,
  link_ms: 2,
  tick_wait_ms: 3,
  apply_ms: 1,
  rate_wait_ms: 0,
  measure_ms: 1,
  back_ms: 1,
};
const PICTURE: PictureSpans = {
  camera_wait_ms: 4,
  capture_ms: 1,
  link_wait_ms: 0,
  encoder_wait_ms: 1,
  encode_ms: 2,
  packetise_ms: 0,
  send_ms: 1,
};

function told(events: readonly number[], pictures: Traces["pictures"] = []): Traces {
  return { type: "traces", pictures, commands: events.map((event) => ({ event, spans: COMMAND })) };
}

function picture(stamp: number, rtp_time = 90): Traces["pictures"][number] {
  return { stream: "front", stamp, rtp_time, spans: PICTURE };
}

describe("a command's trace", () => {
  it("leaves what lies between the clocks as the remainder of its event", () => {
    const book = new TraceBook();
    book.noteSent(5, 1000, 8);
    book.noteAnswered(5, 1030, 1030.5);
    book.noteTold(told([5]));
    const [traced] = book.commands.all();
    expect(traced?.totalMs).toBe(30);
    expect(traced?.spans).toEqual({ ...COMMAND, input_ms: 8, take_ms: 0.5, between_ms: 21 });
  });

  it("is the same when the console tells its part before the feedback comes", () => {
    const book = new TraceBook();
    book.noteSent(5, 1000, null);
    book.noteTold(told([5]));
    book.noteAnswered(5, 1030, 1031);
    expect(book.commands.all()[0]?.spans.between_ms).toBe(21);
    expect(book.commands.all()[0]?.spans).not.toHaveProperty("input_ms");
  });

  it("counts from the first sending, and to the first feedback", () => {
    const book = new TraceBook();
    book.noteSent(5, 1000, null);
    book.noteSent(5, 1020, null);
    book.noteAnswered(5, 1030, 1030);
    book.noteAnswered(5, 1090, 1090);
    book.noteTold(told([5, 5]));
    expect(book.commands.all().map(({ totalMs }) => totalMs)).toEqual([30]);
  });

  it("begins anew after a refusal", () => {
    const book = new TraceBook();
    book.noteSent(5, 1000, null);
    book.noteRefused(5);
    book.noteSent(5, 2000, null);
    book.noteAnswered(5, 2030, 2030);
    book.noteTold(told([5]));
    expect(book.commands.all()[0]?.totalMs).toBe(30);
  });

  it("is not made of another page's command", () => {
    const book = new TraceBook();
    book.noteAnswered(5, 1030, 1030);
    book.noteTold(told([5]));
    expect(book.commands.all()).toEqual([]);
  });
});

describe("a picture's trace", () => {
  const drawn = {
    rtpTimestamp: 90,
    stamp: 5,
    drawnMs: 1060,
    spans: { decode_ms: 3, gate_ms: 0, draw_ms: 1 },
  };

  it("joins both halves by the RTP timestamp, whichever comes first", () => {
    for (const first of ["drawn", "told"]) {
      const book = new TraceBook();
      if (first === "drawn") book.noteDrawn("front", drawn);
      book.noteTold(told([], [picture(5)]));
      if (first === "told") book.noteDrawn("front", drawn);
      expect(book.pictures.all()).toEqual([
        { stream: "front", stamp: 5, atMs: 1060, spans: { ...PICTURE, ...drawn.spans } },
      ]);
    }
  });

  it("has the remainder of its event, from the command's sending to the canvas", () => {
    const book = new TraceBook();
    book.noteSent(5, 1000, null);
    book.noteAnswered(5, 1030, 1030);
    book.noteTold(told([5]));
    book.noteDrawn("front", drawn);
    book.noteTold(told([], [picture(5)]));
    // 60 ms, less 6 of the command until its feedback, less 9 of the picture until the network, less 4 on the page
    expect(book.pictures.all()[0]?.spans.between_ms).toBe(41);
  });

  it("has no remainder while this page sends no commands", () => {
    const book = new TraceBook();
    book.noteDrawn("front", drawn);
    book.noteTold(told([5], [picture(5)]));
    expect(book.pictures.all()[0]?.spans).not.toHaveProperty("between_ms");
  });

  it("is not joined across connections", () => {
    const book = new TraceBook();
    book.noteDrawn("front", drawn);
    book.forget();
    book.noteTold(told([], [picture(5)]));
    expect(book.pictures.all()).toEqual([]);
  });

  it("takes bounded memory, whatever the console tells", () => {
    const book = new TraceBook();
    for (let at = 0; at < 10_000; at++) {
      book.noteSent(at + 1, at, null);
      book.noteTold(told([at + 1], [picture(at + 1, at)]));
    }
    book.noteDrawn("front", { ...drawn, rtpTimestamp: 1 });
    expect(book.pictures.all()).toEqual([]); // its other half was forgotten
    book.noteDrawn("front", { ...drawn, rtpTimestamp: 9_999 });
    expect(book.pictures.all().length).toBe(1);
  });
});

describe("what a recording keeps of a page's events", () => {
  it("are those that took longest, with this page's own spans alone", () => {
    const book = new TraceBook();
    for (let event = 1; event <= 6; event++) {
      book.noteSent(event, 1000 * event, null);
      book.noteAnswered(event, 1000 * event + 10 * event, 1000 * event + 10 * event);
      book.noteDrawn("front", {
        rtpTimestamp: event,
        stamp: event,
        drawnMs: 1000 * event + 100,
        spans: { decode_ms: 3 },
      });
      book.noteTold(told([event], [picture(event, event)]));
    }
    const kept = slowestEvents(book, "front", 0);
    expect(kept.map(({ event }) => event)).toEqual([6, 5, 4, 3]);
    expect(kept[0]?.command).toEqual({ between_ms: 51, take_ms: 0 });
    expect(Object.keys(kept[0]?.picture ?? {}).sort()).toEqual(["between_ms", "decode_ms", "send_ms"]);
    expect(slowestEvents(book, "front", 7000)).toEqual([]);
  });
});
