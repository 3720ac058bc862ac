import "./style/episodes_page.css";
import { EpisodesApi } from "./episodes/episodes_api";
import { EpisodesPage } from "./episodes/view/episodes_page";
import { readReplayLink, replayHash } from "./replay/replay_link";
import { ConsoleApi } from "./transport/signalling/console_api";
import { h } from "./ui/elements/dom";

const { token, recording } = readReplayLink(location.hash);
const recordings = h(
  "a",
  "bar-link",
  { href: `./recordings${replayHash({ token, recording: null, event: null })}` },
  "Recordings",
);
const bar = h("header", "bar recordings-bar", {}, h("span", "bar-brand", {}, "Lockstep"), recordings);
const page =
  token === "" ? null : new EpisodesPage(new EpisodesApi(new ConsoleApi(token)), token, recording ?? "");
const content =
  page?.element ??
  h(
    "main",
    "recordings-message",
    {},
    h("h1", "", {}, "Episodes"),
    h(
      "p",
      "muted",
      {},
      "This link does not say who you are. Open the page from the console: People, then Episodes.",
    ),
  );
document.body.replaceChildren(h("div", "recordings", {}, bar, content));

// Another link pasted into the same tab changes only the fragment.
addEventListener("hashchange", () => location.reload());
