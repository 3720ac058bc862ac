import { describe, expect, it } from "vitest";
import {
  completeOffer,
  feedMids,
  parseJanus,
  parseRelayAnswer,
  wantedMids,
} from "../../src/sfu/janus_messages";

const STREAM = {
  mid: "0",
  stream: "overview",
  label: "Overview",
  kind: "video",
  codec: "H264",
  carrier: "trailer",
};
const TICKET = {
  engine: "janus",
  relay: "1",
  url: "ws://relay:8188",
  room: 4711,
  pin: "secret",
  feed: 5,
  streams: [STREAM],
};

describe("the console's answer about relays", () => {
  it("names a relay, or none", () => {
    expect(parseRelayAnswer({ relay: TICKET })?.streams).toEqual([STREAM]);
    expect(parseRelayAnswer({ relay: null })).toBeNull();
  });

  it("is taken for none when it is of another kind", () => {
    for (const wrong of [
      null,
      7,
      {},
      { relay: { ...TICKET, engine: "other" } },
      { relay: { ...TICKET, feed: "5" } },
      { relay: { ...TICKET, room: "4711" } },
      { relay: { ...TICKET, pin: undefined } },
    ])
      expect(parseRelayAnswer(wrong)).toBeNull();
  });

  it("leaves out streams without stamps that survive a relay", () => {
    const answer = { relay: { ...TICKET, streams: [{ ...STREAM, carrier: "native" }, { kind: "video" }] } };
    expect(parseRelayAnswer(answer)?.streams).toEqual([]);
  });

  it("asks for the feedback behind the media", () => {
    const ticket = parseRelayAnswer({ relay: TICKET });
    expect(ticket && wantedMids(ticket)).toEqual(["0", "1"]);
  });
});

describe("a message of a Janus", () => {
  it("is an answer with data and an offer", () => {
    const message = parseJanus(
      JSON.stringify({
        janus: "event",
        transaction: "t",
        plugindata: { data: { videoroom: "attached" } },
        jsep: { type: "offer", sdp: "v=0" },
      }),
    );
    expect(message).toMatchObject({
      kind: "answer",
      transaction: "t",
      sdp: "v=0",
      data: { videoroom: "attached" },
    });
  });

  it("is an error from the core and from the plugin alike", () => {
    const core = { janus: "error", error: { code: 1, reason: "no" } };
    const plugin = { janus: "event", plugindata: { data: { error_code: 1, error: "no" } } };
    for (const each of [core, plugin])
      expect(parseJanus(JSON.stringify(each))).toMatchObject({ kind: "error", detail: "no" });
  });

  it("is nothing when it cannot be read", () => {
    for (const wrong of [null, "", "{", "[]", "{}", '{"janus":1}', new ArrayBuffer(1)])
      expect(parseJanus(wrong)).toBeNull();
  });
});

describe("a Janus' offer", () => {
  it("gets the format of H.264 where it has none", () => {
    expect(completeOffer("a=rtpmap:96 H264/90000\r\na=mid:0\r\n")).toBe(
      "a=rtpmap:96 H264/90000\r\na=fmtp:96 profile-level-id=42e01f;packetization-mode=1\r\na=mid:0\r\n",
    );
  });

  it("is left alone where it has one", () => {
    const offer = "a=rtpmap:96 H264/90000\r\na=fmtp:96 profile-level-id=42001f\r\n";
    expect(completeOffer(offer)).toBe(offer);
  });

  it("comes with the publisher's names of its sections", () => {
    const data = { streams: [{ mid: "0", feed_mid: "3" }, { mid: "1" }, 7] };
    expect([...feedMids(data)]).toEqual([["0", "3"]]);
  });
});
