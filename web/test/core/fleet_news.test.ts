import { expect, it } from "vitest";
import { parseFleet } from "../../src/core/fleet_answer";
import {
  UNKNOWN_MS,
  clockWords,
  createFleetNews,
  fleetPhase,
  tookAnswer,
  tookTrouble,
} from "../../src/core/fleet_news";

const ANSWER = parseFleet({ robots: [] }) ?? { role: "", robots: [], notices: [] };

it("is loading until the first answer, also while the console does not answer", () => {
  const news = createFleetNews();
  expect(fleetPhase(news, 0)).toBe("loading");
  tookTrouble(news, { why: "console_unreachable" });
  expect(fleetPhase(news, 60_000)).toBe("loading");
});

it("is live while answers come, and unknown when they are late", () => {
  const news = createFleetNews();
  tookAnswer(news, ANSWER, 990, 1000, 5_000_000);
  expect(fleetPhase(news, 999 + UNKNOWN_MS)).toBe("live");
  tookTrouble(news, { why: "console_unreachable" });
  expect(fleetPhase(news, 1000 + UNKNOWN_MS)).toBe("unknown");
  expect(news.heardAt).toBe(5_000_000);
  tookAnswer(news, ANSWER, 9000, 9010, 5_009_000);
  expect(fleetPhase(news, 9020)).toBe("live");
  expect(news.trouble).toBeNull();
});

it("shows nothing any more to a link that is good for nothing any more", () => {
  for (const trouble of [
    { ended: "link_revoked" },
    { why: "token_refused" },
    { why: "origin_refused" },
  ] as const) {
    const news = createFleetNews();
    tookAnswer(news, ANSWER, 0, 10, 0);
    tookTrouble(news, trouble);
    expect(fleetPhase(news, 20)).toBe("shut_out");
    expect(news.answer).toBeNull();
  }
});

it("tells the time of day to the second", () => {
  expect(clockWords(new Date(2026, 10, 21, 7, 5, 9).getTime())).toBe("07:05:09");
});
