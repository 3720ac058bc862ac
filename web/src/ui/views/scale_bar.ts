import type { ConsoleEngine } from "../../engine/console_engine";
import { lengthLabel, roundLength } from "../../util/units";
import { h, setHidden, setText, type Panel } from "../elements/dom";

const SHARE = 0.22; // of the picture's width, at most

/** A bar of known length in the large view, of a camera whose pictures have a scale. */
export function createScaleBar(engine: ConsoleEngine, largeStream: () => string | null): Panel {
  const line = h("span", "scale-line", { "aria-hidden": "true" });
  const words = h("span", "scale-words");
  const element = h("div", "scale-bar", { role: "group", "aria-label": "Scale" }, words, line);
  return {
    element,
    update() {
      const stream = largeStream();
      const camera = engine.state.robot?.description.cameras.find((each) => each.name === stream);
      const canvas = stream === null ? undefined : engine.streams.videos.get(stream)?.canvas;
      const across = (camera?.metres_per_pixel ?? 0) * (camera?.width ?? 0);
      const length = roundLength(across * SHARE);
      const shown = canvas === undefined ? null : pictureBox(canvas);
      setHidden(element, length === 0 || shown === null);
      if (length === 0 || shown === null) return;
      line.style.width = `${((shown.width * length) / across).toFixed(1)}px`;
      element.style.right = `${(shown.right + 14).toFixed(1)}px`;
      element.style.bottom = `${(shown.bottom + 12).toFixed(1)}px`;
      setText(words, lengthLabel(length));
    },
  };
}

/** Where the picture is on its canvas, which keeps its proportions: CSS pixels. */
function pictureBox(canvas: HTMLCanvasElement): { width: number; right: number; bottom: number } | null {
  const [wide, high] = [canvas.clientWidth, canvas.clientHeight];
  if (wide === 0 || high === 0 || canvas.width === 0 || canvas.height === 0) return null;
  const share = Math.min(wide / canvas.width, high / canvas.height);
  const [width, height] = [canvas.width * share, canvas.height * share];
  const left = parseFloat(getComputedStyle(canvas).objectPosition) / 100; // "50% 50%": in the middle
  return { width, right: (wide - width) * (1 - left), bottom: (high - height) / 2 };
}
