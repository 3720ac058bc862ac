/**
 * What stands in the page itself: it opens the connection to the console, and only then asks for the rest of the page,
 * so that the offer takes the connection that the page came on.
 */
import { readFragment } from "./util/url_fragment";
import { newReader } from "./transport/encoded_transform/stamp_reader";
import { preconnect } from "./transport/webrtc/preconnection";

/** The page's other files, as attributes of elements; vite.config.ts puts them in. */
declare const REST: readonly {
  readonly tag: string;
  readonly attributes: Readonly<Record<string, string>>;
}[];

function begin(): Promise<void> {
  const link = readFragment(location.hash);
  // An observer asks first whether to watch through a relay.
  if (link.token === null || link.watches) return Promise.resolve();
  try {
    window.lockstepFirst = preconnect(link, link.token, newReader());
    return window.lockstepFirst.posted;
  } catch {
    return Promise.resolve(); // without WebRTC: the rest of the page says so
  }
}

window.lockstepReader = newReader;
void begin().then(() => {
  for (const { tag, attributes } of REST) {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    document.head.append(element);
  }
});
