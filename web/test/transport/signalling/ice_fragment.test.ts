import { expect, it } from "vitest";
import { iceCandidates, iceFragment, restartedAnswer } from "../../../src/transport/signalling/ice_fragment";

const HOST = "a=candidate:1 1 udp 2113937151 6c2f.local 50001 typ host";
const RELAY = "a=candidate:2 1 udp 33562367 192.0.2.7 50002 typ relay raddr 0.0.0.0 rport 0";
const section = (kind: string, mid: string): string[] => [
  `m=${kind} 9 UDP/TLS/RTP/SAVPF 96`,
  `a=mid:${mid}`,
  "a=ice-ufrag:abcd",
  "a=ice-pwd:0123456789012345678901",
  HOST,
  RELAY,
];
const OFFER = ["v=0", "a=group:BUNDLE 0 1", ...section("video", "0"), ...section("audio", "1"), ""].join(
  "\r\n",
);

it("a fragment has the credentials, the bundle's section and what says where we are", () => {
  expect(iceFragment(OFFER, true).split("\r\n")).toEqual([
    "a=ice-ufrag:abcd",
    "a=ice-pwd:0123456789012345678901",
    "m=video 9 UDP/TLS/RTP/SAVPF 96",
    "a=mid:0",
    RELAY,
    "a=end-of-candidates",
    "",
  ]);
  expect(iceFragment(OFFER, false)).not.toContain("end-of-candidates");
  expect(iceCandidates(OFFER)).toEqual([RELAY]);
});

it("the answer after a restart has new credentials everywhere and new candidates once", () => {
  const fragment = [
    "a=ice-ufrag:new1",
    "a=ice-pwd:abcdefghijabcdefghijab",
    "m=video 9 UDP/TLS/RTP/SAVPF 0",
    "a=mid:0",
    "a=candidate:9 1 udp 1 198.51.100.1 6000 typ host",
    "a=end-of-candidates",
    "",
  ].join("\r\n");
  const answer = restartedAnswer(OFFER, fragment)?.split("\r\n") ?? [];
  expect(answer.filter((line) => line === "a=ice-ufrag:new1")).toHaveLength(2);
  expect(answer.filter((line) => line === "a=ice-pwd:abcdefghijabcdefghijab")).toHaveLength(2);
  expect(answer.filter((line) => line.startsWith("a=candidate"))).toEqual([
    "a=candidate:9 1 udp 1 198.51.100.1 6000 typ host",
  ]);
  expect(answer.indexOf("a=end-of-candidates")).toBeLessThan(
    answer.indexOf("m=audio 9 UDP/TLS/RTP/SAVPF 96"),
  );
  expect(answer.at(-1)).toBe("");
});

it("a fragment without credentials restarts nothing", () => {
  expect(restartedAnswer(OFFER, "a=ice-ufrag:only\r\n")).toBeNull();
  expect(restartedAnswer(OFFER, "")).toBeNull();
});
