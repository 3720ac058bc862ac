import type { TouchInputs } from "../drive/axis_mapping";
import { shapeStick } from "../gamepad/stick_shape";

type Side = "left" | "right";

interface Stick {
  readonly pad: HTMLElement;
  readonly knob: HTMLElement;
  pointer: number | null;
  x: number; // right is positive
  y: number; // up is positive
}

/** Two on-screen sticks. Touching one holds the deadman. */
export class TouchSticks {
  onchange: (at: number) => void = () => undefined; // a finger has moved or was lifted, at this time
  private readonly sticks: Record<Side, Stick>;

  constructor(left: HTMLElement, right: HTMLElement) {
    this.sticks = { left: this.createStick(left), right: this.createStick(right) };
  }

  get deadman(): boolean {
    return this.sticks.left.pointer !== null || this.sticks.right.pointer !== null;
  }

  get inputs(): TouchInputs {
    const { left, right } = this.sticks;
    return {
      left_x: shapeStick(left.x),
      left_y: shapeStick(left.y),
      right_x: shapeStick(right.x),
      right_y: shapeStick(right.y),
    };
  }

  release(): void {
    for (const stick of Object.values(this.sticks)) letGo(stick);
  }

  private createStick(pad: HTMLElement): Stick {
    const knob = document.createElement("div");
    knob.className = "stick-knob";
    pad.append(knob);
    const stick: Stick = { pad, knob, pointer: null, x: 0, y: 0 };
    pad.addEventListener("pointerdown", (event) => {
      if (stick.pointer !== null) return;
      event.preventDefault();
      stick.pointer = event.pointerId;
      pad.setPointerCapture(event.pointerId);
      pad.classList.add("is-held");
      this.moved(stick, event);
    });
    // The first comes as the device reports, the second once for each frame of the screen; not all browsers have the
    // first, and none has it outside of a secure context.
    for (const type of ["pointerrawupdate", "pointermove"] as const)
      pad.addEventListener(type, (event) => {
        if (event instanceof PointerEvent && event.pointerId === stick.pointer) this.moved(stick, event);
      });
    for (const type of ["pointerup", "pointercancel", "lostpointercapture"] as const)
      pad.addEventListener(type, (event) => {
        if (event.pointerId !== stick.pointer) return;
        letGo(stick);
        this.onchange(event.timeStamp);
      });
    pad.addEventListener("contextmenu", (event) => event.preventDefault());
    return stick;
  }

  private moved(stick: Stick, event: PointerEvent): void {
    move(stick, event);
    this.onchange(event.timeStamp);
  }
}

function move(stick: Stick, event: PointerEvent): void {
  const box = stick.pad.getBoundingClientRect();
  const radius = Math.min(box.width, box.height) / 2;
  const x = (event.clientX - box.left - box.width / 2) / radius;
  const y = -(event.clientY - box.top - box.height / 2) / radius;
  const reach = Math.max(1, Math.hypot(x, y));
  stick.x = x / reach;
  stick.y = y / reach;
  stick.knob.style.transform = `translate(${(stick.x * radius * 0.6).toFixed(1)}px, ${(-stick.y * radius * 0.6).toFixed(1)}px)`;
}

function letGo(stick: Stick): void {
  stick.pointer = null;
  stick.x = 0;
  stick.y = 0;
  stick.knob.style.transform = "";
  stick.pad.classList.remove("is-held");
}
