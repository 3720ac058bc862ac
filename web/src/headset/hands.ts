import type { PadInputs } from "../gamepad/mapping";
import type { HeadsetControls } from "../input/controls";
import { createHeadsetInput, letGo, takeFrame, type HeadsetEvent } from "../xr/headset_input";
import type { HandReading } from "./xr_hands";

/** The hands of one session as the page's controls. */
export class Hands implements HeadsetControls {
  readonly input = createHeadsetInput();
  readings: readonly HandReading[] = []; // of the newest frame

  /** Takes the hands of a frame. Returns what they have done. */
  take(readings: readonly HandReading[], now: number): HeadsetEvent[] {
    this.readings = readings;
    const samples = readings.map(({ sample }) => sample);
    return takeFrame(this.input, samples, now);
  }

  get deadman(): boolean {
    return this.input.held.size > 0;
  }

  get inputs(): PadInputs {
    return this.input.inputs;
  }

  get gamepad(): Gamepad | null {
    return this.readings.find(({ sample }) => this.input.held.has(sample.side))?.gamepad ?? null;
  }

  /** The places of the hands, to the centimetre: one that holds still for a minute is no hand. */
  get signature(): string {
    const places = this.readings.map(({ sample }) =>
      sample.pose?.position.map((part) => part.toFixed(2)).join(),
    );
    return places.join(" ");
  }

  release(): void {
    letGo(this.input);
  }
}
