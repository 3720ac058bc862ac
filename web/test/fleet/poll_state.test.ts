import { expect, it } from "vitest";
import { parseFleet } from "../../src/fleet/fleet_status";
import {
  UNKNOWN_MS,
  clockLabel,
  createPollState,
  pollPhase,
  tookAnswer,
  tookError,
} from "../../src/fleet/poll_state";

const ANSWER = parseFleet({ robots: [] }) ?? { role: "", robots: [], notices: [] };

it("is loading until the first answer, also while the console does not answer", () => {
  const news = createPollState();
  expect(pollPhase(news, 0)).toBe("loading");
  tookError(news, { why: "console_unreachable" });
  expect(pollPhase(news, 60_000)).toBe("loading");
});

it("is live while answers come, and unknown when they are late", () => {
  const news = createPollState();
  tookAnswer(news, ANSWER, 990, 1000, 5_000_000);
  expect(pollPhase(news, 999 + UNKNOWN_MS)).toBe("live");
  tookError(news, { why: "console_unreachable" });
  expect(pollPhase(news, 1000 + UNKNOWN_MS)).toBe("unknown");
  expect(news.heardAt).toBe(5_000_000);
  tookAnswer(news, ANSWER, 9000, 9010, 5_009_000);
  expect(pollPhase(news, 9020)).toBe("live");
  expect(news.trouble).toBeNull();
});

it("shows nothing any more to a link that is good for nothing any more", () => {
  for (const trouble of [
    { ended: "link_revoked" },
    { why: "token_refused" },
    { why: "origin_refused" },
  ] as const) {
    const news = createPollState();
    tookAnswer(news, ANSWER, 0, 10, 0);
    tookError(news, trouble);
    expect(pollPhase(news, 20)).toBe("shut_out");
    expect(news.answer).toBeNull();
  }
});

it("tells the time of day to the second", () => {
  expect(clockLabel(new Date(2026, 10, 21, 7, 5, 9).getTime())).toBe("07:05:09");
});
