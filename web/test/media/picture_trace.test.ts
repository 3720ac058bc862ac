import { describe, expect, it } from "vitest";
import { PictureTrace } from "../../src/media/picture_trace";

const EPOCH = performance.timeOrigin;

describe("a picture's trace on the page", () => {
  it("has the spans between the points that its decoder called", () => {
    const trace = new PictureTrace();
    trace.transformed(90, { receivedMs: EPOCH + 100, enteredMs: EPOCH + 104, leftMs: EPOCH + 104.5 });
    trace.decoded(90, 110);
    const drawn = trace.drawn(7, 115, 116);
    expect(drawn?.rtpTimestamp).toBe(90);
    expect(drawn?.stamp).toBe(7);
    const { assemble_ms, transform_ms, decode_ms, gate_ms, draw_ms } = drawn?.spans ?? {};
    expect(assemble_ms).toBeCloseTo(4, 1);
    expect(transform_ms).toBeCloseTo(0.5, 1);
    expect(decode_ms).toBeCloseTo(5.5, 1);
    expect([gate_ms, draw_ms]).toEqual([5, 1]);
  });

  it("leaves a span out where the browser does not say when the packets came", () => {
    const trace = new PictureTrace();
    trace.transformed(90, { receivedMs: null, enteredMs: EPOCH + 104, leftMs: EPOCH + 104.5 });
    trace.decoded(90, 110);
    expect(trace.drawn(7, 110, 111)?.spans).not.toHaveProperty("assemble_ms");
  });

  it("has only the page's gate and canvas where no transform saw the picture", () => {
    const trace = new PictureTrace();
    trace.decoded(90, 110);
    expect(trace.drawn(null, 112, 113)?.spans).toEqual({ gate_ms: 2, draw_ms: 1 });
  });

  it("is of the picture that was offered last: the gate keeps no other", () => {
    const trace = new PictureTrace();
    trace.decoded(90, 110);
    trace.decoded(91, 120);
    expect(trace.drawn(7, 121, 122)?.rtpTimestamp).toBe(91);
    expect(trace.drawn(7, 123, 124)).toBeNull();
  });

  it("never has a negative span, though a clock was set between two looks at it", () => {
    const trace = new PictureTrace();
    trace.transformed(90, { receivedMs: EPOCH + 200, enteredMs: EPOCH + 104, leftMs: EPOCH + 104 });
    trace.decoded(90, 50);
    expect(trace.drawn(7, 50, 51)?.spans).toMatchObject({ assemble_ms: 0, decode_ms: 0 });
  });

  it("keeps a bounded number of pictures that were never drawn", () => {
    const trace = new PictureTrace();
    for (let at = 0; at < 1000; at++)
      trace.transformed(at, { receivedMs: null, enteredMs: EPOCH, leftMs: EPOCH });
    trace.decoded(0, 1);
    expect(trace.drawn(1, 1, 2)?.spans).not.toHaveProperty("decode_ms");
    trace.decoded(999, 1);
    expect(trace.drawn(1, 1, 2)?.spans).toHaveProperty("decode_ms");
  });
});
