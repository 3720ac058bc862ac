import { describe, expect, it } from "vitest";
import { expectsPong } from "../../src/transport/expects_pong";

describe("which of our messages are answered", () => {
  it("are pings, alone and in reports", () => {
    expect(expectsPong('{"type":"ping","id":1}')).toBe(true);
    expect(expectsPong('{"type":"report","event":1,"ping":4}')).toBe(true);
  });

  it("are no others: nobody waits for an answer to them", () => {
    for (const text of [
      '{"type":"report","event":1,"ping":null}',
      '{"type":"stop","by":"","reason":"\\"ping\\":1"}',
      '{"type":"note","text":"ping"}',
      "null",
    ])
      expect(expectsPong(text), text).toBe(false);
  });
});
