import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Display } from "../../src/input/display";

/** The window's frames, given by hand. */
class Window {
  private readonly asked = new Map<number, FrameRequestCallback>();
  private last = 0;
  readonly document = { hidden: false };

  request = (callback: FrameRequestCallback): number => {
    this.asked.set(++this.last, callback);
    return this.last;
  };

  cancel = (handle: number): void => {
    this.asked.delete(handle);
  };

  get count(): number {
    return this.asked.size;
  }

  frame(now: number): void {
    const due = [...this.asked.values()];
    this.asked.clear();
    for (const callback of due) callback(now);
  }
}

/** A loop that asks for the next frame in each, as the page's drawing does. */
function loop(display: Display): number[] {
  const seen: number[] = [];
  const step = (now: number): void => {
    display.request(step);
    seen.push(now);
  };
  display.request(step);
  return seen;
}

let page: Window;

beforeEach(() => {
  page = new Window();
  vi.stubGlobal("requestAnimationFrame", page.request);
  vi.stubGlobal("cancelAnimationFrame", page.cancel);
  vi.stubGlobal("document", page.document);
});

afterEach(() => vi.unstubAllGlobals());

describe("the page's frames", () => {
  it("are the window's", () => {
    const seen = loop(new Display());
    page.frame(1);
    page.frame(2);
    expect(seen).toEqual([1, 2]);
    expect(page.count).toBe(1);
  });

  it("are the session's while it lasts, also of a loop that waits for a frame of a silent window", () => {
    const display = new Display();
    const seen = loop(display);
    display.enter({ visible: true });
    expect(page.count).toBe(0);
    display.frame(1);
    display.frame(2);
    page.frame(3);
    expect(seen).toEqual([1, 2]);
    display.leave();
    page.frame(4);
    page.frame(5);
    expect(seen).toEqual([1, 2, 4, 5]);
    expect(page.count).toBe(1);
  });

  it("are asked for once, however many wait, and not for one that was cancelled", () => {
    const display = new Display();
    const seen: string[] = [];
    display.request(() => seen.push("one"));
    const other = display.request(() => seen.push("other"));
    expect(page.count).toBe(1);
    display.cancel(other);
    page.frame(1);
    expect(seen).toEqual(["one"]);
    expect(page.count).toBe(0);
  });

  it("reach the others when one throws", () => {
    const reported = vi.fn();
    vi.stubGlobal("reportError", reported);
    const display = new Display();
    const seen: string[] = [];
    const error = new Error("broken");
    display.request(() => {
      throw error;
    });
    display.request(() => seen.push("other"));
    page.frame(1);
    expect(seen).toEqual(["other"]);
    expect(reported).toHaveBeenCalledWith(error);
  });
});

describe("the page is seen", () => {
  it("as the window's document says", () => {
    const display = new Display();
    expect(display.visible).toBe(true);
    page.document.hidden = true;
    expect(display.visible).toBe(false);
  });

  it("as the session says while it lasts, whatever the document says", () => {
    const display = new Display();
    const session = { visible: true };
    page.document.hidden = true;
    display.enter(session);
    expect([display.visible, display.isImmersive]).toEqual([true, true]);
    session.visible = false;
    expect(display.visible).toBe(false);
    display.leave();
    page.document.hidden = false;
    expect([display.visible, display.isImmersive]).toEqual([true, false]);
  });
});
