import type { PollError, PollPhase } from "../poll_state";
import { tokenIn } from "../../replay/replay_link";
import {
  CONNECTION_END_LABELS,
  CONNECTION_ERROR_LABELS,
  type ConnectionErrorLabels,
} from "../../transport/connection_error";
import { button, h, setText } from "../../ui/elements/dom";

/** Why there are no tiles, and what to do about it. `field`: where another link can be pasted. */
export interface FleetMessage extends ConnectionErrorLabels {
  readonly key: string; // the same key is the same message
  readonly action: "paste" | "clear" | null;
}

export const NO_LINK: FleetMessage = {
  key: "no_link",
  title: "Open the link",
  text: "This page needs the link that lockstep serve printed, or a link that somebody gave you. The link ends in #token=…",
  action: "paste",
};

const NO_ROBOTS: FleetMessage = {
  key: "no_robots",
  title: "No robots",
  text: "Your link admits to none of this console’s robots. Ask the person who runs the console for another link.",
  action: "paste",
};

function notFound(query: string): FleetMessage {
  return {
    key: `not_found ${query}`,
    title: "No robot found",
    text: `No robot’s name contains “${query}”.`,
    action: "clear",
  };
}

function shutOut(trouble: PollError): FleetMessage {
  const words =
    "ended" in trouble ? CONNECTION_END_LABELS[trouble.ended] : CONNECTION_ERROR_LABELS[trouble.why];
  return { key: words.title, ...words, action: "paste" };
}

/** What stands in the tiles' place; null: the tiles. `robots`: that there are; `shown`: that pass the filter `query`. */
export function messageOf(
  phase: PollPhase,
  known: {
    readonly trouble: PollError | null;
    readonly robots: number;
    readonly shown: number;
    readonly query: string;
  },
): FleetMessage | null {
  if (phase === "shut_out") return known.trouble === null ? null : shutOut(known.trouble);
  if (phase === "loading") return null;
  if (known.robots === 0) return NO_ROBOTS;
  return known.shown === 0 ? notFound(known.query) : null;
}

/** `clear`: shows all robots again. */
export function messageElement(message: FleetMessage, clear: () => void): HTMLElement {
  const title = h("h2", "message-title", {}, message.title);
  const text = h("p", "message-text", { role: "status" }, message.text);
  const element = h("div", "fleet-message", {}, title, text);
  if (message.action === "clear") element.append(button("field-button", "Show all robots", clear));
  if (message.action === "paste") element.append(pasteForm());
  return element;
}

function pasteForm(): HTMLElement {
  const field = h("input", "field", {
    type: "password",
    "aria-label": "Your link",
    placeholder: "Paste your link",
    autocomplete: "off",
  });
  const trouble = h("p", "library-trouble", { role: "alert" });
  trouble.hidden = true;
  setText(trouble, "This is not a link of a console: it has no token after the #.");
  const send = h("button", "field-button", { type: "submit" }, "Open");
  const form = h("form", "message-form", {}, field, send, trouble);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const token = tokenIn(field.value);
    trouble.hidden = token !== "";
    if (token !== "") location.hash = `#${new URLSearchParams({ token })}`;
  });
  return form;
}
