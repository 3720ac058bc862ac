import "./style/recordings_page.css";
import { readReplayLink, replayHash, tokenIn } from "./replay/replay_link";
import { ListView } from "./replay/view/list_view";
import { startDecoders } from "./replay/picture_decoder";
import { PlayerView } from "./replay/view/player_view";
import { RecordingsApi } from "./replay/recordings_api";
import { installReplayHook } from "./replay/view/replay_hook";
import { ConsoleApi } from "./transport/signalling/console_api";
import { requestErrorLabel } from "./transport/signalling/session_api";
import { button, h, setText } from "./ui/elements/dom";

interface View {
  readonly element: HTMLElement;
  close(): void;
}

let view: View | null = null;

function put(next: View): void {
  view?.close();
  view = next;
  const home = h(
    "a",
    "bar-brand",
    { href: `./${replayHash({ ...here(), recording: null, event: null })}` },
    "Lockstep",
  );
  const { token } = here();
  const episodes = h(
    "a",
    "bar-link",
    { href: `./episodes${replayHash({ token, recording: null, event: null })}` },
    "Episodes",
  );
  const bar = h("header", "bar recordings-bar", {}, home, ...(token === "" ? [] : [episodes]));
  document.body.replaceChildren(h("div", "recordings", {}, bar, next.element));
}

function here(): ReturnType<typeof readReplayLink> {
  return readReplayLink(location.hash);
}

function go(recording: string | null): void {
  history.pushState(null, "", replayHash({ ...here(), recording, event: null }));
  void route();
}

async function route(): Promise<void> {
  const link = here();
  const api = new RecordingsApi(new ConsoleApi(link.token));
  if (link.token === "") {
    put(askForToken());
    return;
  }
  if (link.recording === null) {
    installReplayHook(null);
    put(new ListView(api, link.token, { open: (entry) => go(entry.id) }));
    return;
  }
  put(message("Opening the recording …", ""));
  startDecoders();
  const waiting = view;
  try {
    const details = await api.details(link.recording, 0);
    if (view !== waiting) return; // somebody went elsewhere meanwhile
    const player = new PlayerView(api, details, link.token, () => go(null));
    put(player);
    installReplayHook(player);
    player.start(link.event);
  } catch (error) {
    if (view === waiting) put(message("The recording cannot be opened", requestErrorLabel(error), true));
  }
}

function message(title: string, words: string, leadsBack = false): View {
  const element = h(
    "main",
    "recordings-message",
    {},
    h("h1", "", {}, title),
    h("p", "", { role: "status" }, words),
  );
  if (leadsBack) element.append(button("field-button", "All recordings", () => go(null)));
  return { element, close: () => undefined };
}

/** A link that somebody shared says which event, but not who opens it. */
function askForToken(): View {
  const field = h("input", "field", { type: "password", "aria-label": "Your own link", autocomplete: "off" });
  const trouble = h("p", "library-trouble", { role: "alert" });
  trouble.hidden = true;
  const form = h(
    "form",
    "recordings-form",
    {},
    field,
    h("button", "field-button", { type: "submit" }, "Open"),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const token = tokenIn(field.value);
    trouble.hidden = token !== "";
    setText(trouble, "This is not a link of a console: it has no token after the #.");
    if (token === "") return;
    history.replaceState(null, "", replayHash({ ...here(), token }));
    void route();
  });
  const words = h(
    "p",
    "muted",
    {},
    "This link does not say who you are. Paste the link that you open the console with.",
  );
  const element = h("main", "recordings-message", {}, h("h1", "", {}, "Recordings"), words, form, trouble);
  return { element, close: () => undefined };
}

/** Another event of the same recording is only sought: by the browser's history, or by a link in the same tab. */
addEventListener("popstate", () => {
  const link = here();
  if (view instanceof PlayerView && view.isOf(link) && link.event !== null) view.start(link.event);
  else void route();
});
addEventListener("keydown", (event) => {
  if (view instanceof PlayerView && view.key(event)) event.preventDefault();
});
addEventListener("resize", () => {
  if (view instanceof PlayerView) view.player.changed();
});
void route();
