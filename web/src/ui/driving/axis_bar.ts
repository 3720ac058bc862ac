import type { Axis } from "../../protocol/wire";

/** One axis on the page. `commanded`: null or undefined while nobody drives it. */
export interface AxisBar {
  readonly axis: Axis;
  readonly element: HTMLElement;
  show(now: number, measured: number | undefined, commanded: number | null | undefined): void;
}
