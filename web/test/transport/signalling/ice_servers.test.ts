import { expect, it } from "vitest";
import { hasTurn, iceServersOf, parseIceServers } from "../../../src/transport/signalling/ice_servers";

const TURN = { urls: ["turn:turn.example:3478?transport=udp"], username: "1:a", credential: "secret" };

it("takes STUN and TURN servers as the console names them", () => {
  const found = parseIceServers({ ice_servers: [{ urls: "stun:stun.example" }, TURN], expires: 1 });
  expect(found).toEqual([{ urls: ["stun:stun.example"] }, TURN]);
  expect(hasTurn(found)).toBe(true);
  expect(hasTurn(found.slice(0, 1))).toBe(false);
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

it("reads the same from the Link headers of an answer", () => {
  const links = [
    '<stun:stun.example>; rel="ice-server"',
    '<turn:turn.example:3478?transport=udp>; rel="ice-server"; username="1:a"; credential="se,c=r;et"; credential-type="password"',
    '<https://elsewhere.example>; rel="ice-server"',
    '<turn:nobody.example>; rel="ice-server"',
    '<stun:other.example>; rel="next"',
  ].join(", ");
  const turn = { ...TURN, credential: "se,c=r;et" };
  expect(iceServersOf(links)).toEqual([{ urls: ["stun:stun.example"] }, turn]);
  for (const links of ["", "<", "stun:stun.example", '<stun:a>; rel="'])
    expect(iceServersOf(links)).toEqual([]);
});

it("takes a bounded number from headers too", () => {
  expect(iceServersOf(Array(50).fill('<stun:a>; rel="ice-server"').join(", "))).toHaveLength(8);
});
