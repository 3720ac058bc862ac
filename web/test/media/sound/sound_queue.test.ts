import { beforeEach, describe, expect, it } from "vitest";
import {
  advance,
  createSoundQueue,
  current,
  enqueue,
  hole,
  peek,
  unbroken,
  type SoundPacket,
  type SoundQueue,
} from "../../../src/media/sound/sound_queue";

let queue: SoundQueue;

beforeEach(() => {
  queue = createSoundQueue();
});

/** Samples that say their own place, from `time` on. */
function packet(time: number, length = 4): SoundPacket {
  const samples = Float32Array.from({ length }, (_, at) => time + at);
  return { time, stamp: 1, arrivedS: 0, gaveWay: 0, samples };
}

function times(): number[] {
  return queue.packets.map(({ time }) => time);
}

describe("the queue of sound", () => {
  it("puts packets into the order of their RTP timestamps", () => {
    for (const time of [8, 0, 4]) expect(enqueue(queue, packet(time))).toBeNull();
    expect(times()).toEqual([0, 4, 8]);
  });

  it("keeps that order where RTP timestamps wrap", () => {
    const last = 0xffff_fffc;
    for (const time of [0, last]) expect(enqueue(queue, packet(time))).toBeNull();
    queue.next = last;
    expect(times()).toEqual([last, 0]);
    expect(unbroken(queue)).toBe(8);
    expect([...peek(queue, 2, 4)]).toEqual([last + 2, last + 3, 0, 1].map(Math.fround));
    advance(queue, 6);
    expect(queue.next).toBe(2);
  });

  it("takes no packet twice, also not the one that plays", () => {
    enqueue(queue, packet(0));
    enqueue(queue, packet(4));
    queue.next = 2;
    expect(enqueue(queue, packet(0))).toBe("again");
    expect(enqueue(queue, packet(4))).toBe("again");
  });

  it("takes no packet whose time is over", () => {
    queue.next = 8;
    expect(enqueue(queue, packet(4))).toBe("late");
    expect(times()).toEqual([]);
  });

  it("takes no packet that is empty or longer than any of Opus", () => {
    expect(enqueue(queue, packet(0, 0))).toBe("not_sound");
    expect(enqueue(queue, packet(0, 5761))).toBe("not_sound");
  });

  it("is unbroken up to the first packet that is missing, and knows how much is missing", () => {
    for (const time of [0, 4, 12]) enqueue(queue, packet(time));
    queue.next = 1;
    expect(unbroken(queue)).toBe(7);
    advance(queue, 7);
    expect(current(queue)).toBeNull();
    expect(hole(queue)).toBe(4);
    enqueue(queue, packet(8));
    expect(unbroken(queue)).toBe(8);
    expect(current(queue)?.time).toBe(8);
  });

  it("has nothing to play and nothing missing while it is empty", () => {
    queue.next = 5;
    expect(unbroken(queue)).toBe(0);
    expect(hole(queue)).toBeNull();
  });
});
