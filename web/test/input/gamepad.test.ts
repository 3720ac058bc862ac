import { afterEach, describe, expect, it, vi } from "vitest";
import { Pad } from "../../src/input/gamepad";
import { GamepadStorage } from "../../src/input/gamepad_storage";

interface Report {
  timestamp: number;
  readonly index: number;
  readonly id: string;
  readonly connected: boolean;
  readonly mapping: string;
  readonly axes: number[];
  readonly buttons: { pressed: boolean; touched: boolean; value: number }[];
}

function pluggedPad(index: number): Report {
  const buttons = Array.from({ length: 17 }, () => ({ pressed: false, touched: false, value: 0 }));
  return {
    timestamp: 1,
    index,
    id: `pad ${index}`,
    connected: true,
    mapping: "standard",
    axes: [0, 0, 0, 0],
    buttons,
  };
}

function padOf(...reports: Report[]): { pad: Pad; plugged: string[] } {
  vi.stubGlobal("navigator", { getGamepads: () => reports });
  vi.stubGlobal("localStorage", { getItem: () => null, setItem: () => undefined });
  const plugged: string[] = [];
  const nothing = (): void => undefined;
  const others = {
    stop: nothing,
    arm: nothing,
    nextLayer: nothing,
    action: nothing,
    lost: nothing,
    silent: nothing,
  };
  const pad = new Pad({ ...others, plugged: (words) => plugged.push(words) }, new GamepadStorage());
  return { pad, plugged };
}

afterEach(() => {
  vi.unstubAllGlobals();
});

describe("a gamepad", () => {
  it("has news from its report until it is read", () => {
    const report = pluggedPad(0);
    const { pad } = padOf(report);
    expect(pad.hasNews).toBe(true);
    pad.poll();
    expect(pad.hasNews).toBe(false);
    report.timestamp = 5;
    expect(pad.hasNews).toBe(true);
    pad.poll();
    expect(pad.hasNews).toBe(false);
  });

  it("that is asked for news is not thereby known: the next read tells that it was plugged in", () => {
    const { pad, plugged } = padOf(pluggedPad(0));
    expect(pad.hasNews).toBe(true);
    pad.poll();
    expect(plugged).toHaveLength(1);
  });

  it("has news when another one reports, since any of them stops the robot", () => {
    const [first, second] = [pluggedPad(0), pluggedPad(1)];
    const { pad } = padOf(first, second);
    pad.poll();
    second.timestamp = 7;
    expect(pad.hasNews).toBe(true);
  });

  it("without times has no news, and is read at the ticks", () => {
    const report = pluggedPad(0);
    report.timestamp = 0;
    const { pad } = padOf(report);
    pad.poll();
    expect(pad.hasNews).toBe(false);
  });
});
