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

function padOf(...reports: Report[]): { pad: Pad; plugged: string[]; told: string[] } {
  vi.stubGlobal("navigator", { getGamepads: () => reports });
  vi.stubGlobal("localStorage", { getItem: () => null, setItem: () => undefined });
  const plugged: string[] = [];
  const told: string[] = [];
  const nothing = (): void => undefined;
  const others = {
    stop: () => told.push("stop"),
    arm: () => told.push("arm"),
    nextLayer: () => told.push("layer"),
    episode: (press: string) => told.push(press),
    action: (index: number) => told.push(`action ${index}`),
    lost: nothing,
    silent: nothing,
  };
  const pad = new Pad({ ...others, plugged: (words) => plugged.push(words) }, new GamepadStorage());
  return { pad, plugged, told };
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

  it("asks of the episode while its button is held, and of nothing else but arming and STOP", () => {
    const report = pluggedPad(0);
    const { pad, told } = padOf(report);
    const hold = (button: number, isDown: boolean): void => {
      report.buttons[button] = { pressed: isDown, touched: isDown, value: Number(isDown) };
      pad.poll();
    };
    const press = (...buttons: number[]): string[] => {
      for (const button of buttons) {
        hold(button, true);
        hold(button, false);
      }
      return told.splice(0);
    };
    const [A, B, X, Y, LB, START, L3, R3, UP] = [0, 1, 2, 3, 4, 9, 10, 11, 12] as const;
    pad.poll();
    expect(press(A, X, Y, LB, L3, R3, UP)).toEqual(["action 0", "action 1", "layer"]);
    hold(LB, true);
    expect(press(A, X)).toEqual(["action 2", "action 3"]);
    hold(LB, false);
    hold(A, true);
    hold(R3, true);
    expect(told.splice(0)).toEqual(["action 0"]); // held already: not pressed anew
    hold(A, false);
    expect(press(A, X, Y, LB, L3)).toEqual(["begin_or_success", "failure", "keep", "discard", "redo"]);
    expect(press(UP, B, START)).toEqual(["mark", "stop", "arm"]);
    hold(L3, true);
    hold(UP, true);
    report.axes[1] = -1;
    pad.poll();
    expect(pad.state?.inputs.dpad_y).toBe(0); // the cross drives nothing meanwhile
    expect(pad.state?.inputs.left_y).toBe(-1); // at the normal speed
    hold(R3, false);
    expect(pad.state?.inputs.dpad_y).toBe(-1);
    expect(told).toEqual(["redo", "mark"]);
  });

  it("without times has no news, and is read at the ticks", () => {
    const report = pluggedPad(0);
    report.timestamp = 0;
    const { pad } = padOf(report);
    pad.poll();
    expect(pad.hasNews).toBe(false);
  });
});
