import type { SliderInputs } from "../drive/axis_mapping";

/** The slider that is held, and the keys that are not the sliders'. */
export interface SliderSample extends SliderInputs {
  readonly otherKeys: ReadonlySet<string>;
}

interface Slider {
  readonly track: HTMLElement;
  pointer: number | null;
  fromX: number; // where it was taken, CSS pixels
  x: number;
  width: number; // when it was taken: a page that is laid out anew moves nothing
}

const FORWARD = ["ArrowRight", "ArrowUp"];
const BACK = ["ArrowLeft", "ArrowDown"];

/**
 * The sliders of goal axes. Holding one holds the deadman, as a touch stick does; dragging it moves the axis' goal by as
 * much as the pointer moves, from wherever the axis is. While a slider has the focus, the arrow keys push its axis.
 */
export class GoalSliders {
  /** A pointer has moved or was lifted, at this time. */
  onchange: (at: number) => void = () => undefined;
  private readonly sliders = new Map<string, Slider>(); // by the axis' name

  get deadman(): boolean {
    return [...this.sliders.values()].some((slider) => slider.pointer !== null);
  }

  /** `keys`: that are held. Those that push an axis do nothing else. */
  sample(keys: ReadonlySet<string>): SliderSample {
    const travels: Record<string, number> = {};
    for (const [name, slider] of this.sliders) if (slider.pointer !== null) travels[name] = travelOf(slider);
    const focused = this.focused();
    if (focused === null) return { travels, pushes: {}, otherKeys: keys };
    const held = (codes: readonly string[]): number => Number(codes.some((code) => keys.has(code)));
    const push = held(FORWARD) - held(BACK);
    const arrows = new Set([...FORWARD, ...BACK]);
    return {
      travels,
      pushes: push === 0 ? {} : { [focused]: push },
      otherKeys: new Set([...keys].filter((code) => !arrows.has(code))),
    };
  }

  release(): void {
    for (const slider of this.sliders.values()) letGo(slider);
  }

  /** Another robot: none of these sliders is on the page any more. */
  forget(): void {
    this.release();
    this.sliders.clear();
  }

  /** `track`: the element that is dragged, as wide as the axis' range. */
  add(axis: string, track: HTMLElement): void {
    const slider: Slider = { track, pointer: null, fromX: 0, x: 0, width: 0 };
    this.sliders.set(axis, slider);
    track.addEventListener("pointerdown", (event) => {
      if (slider.pointer !== null || event.button !== 0) return;
      event.preventDefault(); // no focus: the keyboard stays the robot's
      slider.pointer = event.pointerId;
      slider.fromX = slider.x = event.clientX;
      slider.width = track.getBoundingClientRect().width;
      track.setPointerCapture(event.pointerId);
      track.classList.add("is-held");
      this.onchange(event.timeStamp);
    });
    for (const type of ["pointerrawupdate", "pointermove"] as const)
      track.addEventListener(type, (event) => {
        if (!(event instanceof PointerEvent) || event.pointerId !== slider.pointer) return;
        slider.x = event.clientX;
        this.onchange(event.timeStamp);
      });
    for (const type of ["pointerup", "pointercancel", "lostpointercapture"] as const)
      track.addEventListener(type, (event) => {
        if (event.pointerId !== slider.pointer) return;
        letGo(slider);
        this.onchange(event.timeStamp);
      });
    track.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  private focused(): string | null {
    for (const [name, { track }] of this.sliders) if (track === document.activeElement) return name;
    return null;
  }
}

function travelOf({ fromX, x, width }: Slider): number {
  return width > 0 ? (x - fromX) / width : 0;
}

function letGo(slider: Slider): void {
  slider.pointer = null;
  slider.track.classList.remove("is-held");
}
