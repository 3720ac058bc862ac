import { expect, it } from "vitest";
import { countUnread, createUnread, markRead } from "../../src/session/unread_notes";

it("counts others' notes since the last look, over restarts of the console too", () => {
  const unread = createUnread();
  const notes = [
    { time: 10, peer: "a" },
    { time: 11, peer: "me" },
    { time: 12, peer: "b" },
  ];
  expect(countUnread(unread, notes, "me")).toBe(2);
  markRead(unread, notes);
  expect(countUnread(unread, notes, "me")).toBe(0);
  markRead(unread, []);
  expect(countUnread(unread, [...notes, { time: 13, peer: "a" }], "me")).toBe(1);
});
