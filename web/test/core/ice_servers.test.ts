import { expect, it } from "vitest";
import { hasRelay, parseIceServers } from "../../src/core/ice_servers";

const TURN = { urls: ["turn:turn.example:3478?transport=udp"], username: "1:a", credential: "secret" };

it("takes STUN and TURN servers as the console names them", () => {
  const found = parseIceServers({ ice_servers: [{ urls: "stun:stun.example" }, TURN], expires: 1 });
  expect(found).toEqual([{ urls: ["stun:stun.example"] }, TURN]);
  expect(hasRelay(found)).toBe(true);
  expect(hasRelay(found.slice(0, 1))).toBe(false);
});

it("leaves out what a browser would refuse, and takes none from an answer that is none", () => {
  const listed = [
    { urls: ["http://elsewhere"] },
    { urls: 7 },
    { ...TURN, credential: 5 },
    null,
    { urls: [] },
  ];
  expect(parseIceServers({ ice_servers: listed })).toEqual([]);
  for (const answer of [null, 7, {}, { ice_servers: {} }]) expect(parseIceServers(answer)).toEqual([]);
});

it("takes a bounded number", () => {
  expect(parseIceServers({ ice_servers: Array(50).fill(TURN) })).toHaveLength(8);
});
