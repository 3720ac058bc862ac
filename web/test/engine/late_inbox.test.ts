import { describe, expect, it } from "vitest";
import { LateInbox } from "../../src/engine/late_inbox";
import { lateMisfit } from "../../src/protocol/late_schema";

const TRACES = { type: "traces", pictures: [], commands: [] };
const ANSWER = { type: "episode_answer", id: "x", reason: "empty", detail: "", episode: "" };

class Page {
  readonly unreadable: string[] = [];
  readonly taken: unknown[] = [];
  readonly inbox = new LateInbox((channel, detail) => this.unreadable.push(`${channel}: ${detail}`));

  constructor(isLoaded: boolean) {
    if (!isLoaded) return;
    this.inbox.read(lateMisfit);
    for (const type of ["traces", "episode_answer"])
      this.inbox.take[type] = (message): unknown => this.taken.push(message);
  }
}

describe("messages whose schema comes with later code", () => {
  it("are taken, and the newest of each type is kept", () => {
    const page = new Page(true);
    expect(page.inbox.received("control", "traces", TRACES, 5)).toBe(true);
    expect(page.taken).toEqual([TRACES]);
    expect(page.inbox.newest.get("traces")).toEqual({ channel: "control", message: TRACES, atMs: 5 });
    expect(page.unreadable).toEqual([]);
  });

  it("are counted where they are malformed, and the one before stays the newest", () => {
    const page = new Page(true);
    page.inbox.received("control", "traces", TRACES, 5);
    page.inbox.received("control", "traces", { ...TRACES, pictures: 3 }, 6);
    expect(page.unreadable).toEqual(["control: message.pictures: not array"]);
    expect(page.taken).toEqual([TRACES]);
    expect(page.inbox.newest.get("traces")?.atMs).toBe(5);
  });

  it("wait for it, and are counted where they were malformed when it comes", () => {
    const page = new Page(false);
    page.inbox.received("session", "episode_answer", { ...ANSWER, id: 3 }, 1);
    page.inbox.received("control", "traces", TRACES, 2);
    expect(page.unreadable).toEqual([]);
    page.inbox.read(lateMisfit);
    expect(page.unreadable).toEqual(["session: message.id: not string"]);
    expect([...page.inbox.newest.keys()]).toEqual(["traces"]);
  });

  it("are no others", () => {
    const page = new Page(true);
    expect(page.inbox.received("control", "surprise", { type: "surprise" }, 1)).toBe(false);
    expect(page.inbox.newest.size).toBe(0);
  });
});
