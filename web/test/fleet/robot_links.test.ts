import { describe, expect, it } from "vitest";
import { overviewPage, robotName } from "../../src/fleet/robot_links";
import { isOwnOrigin, robotPage } from "../../src/fleet/robot_pages";

const BASE = "https://hall.example/a/";

describe("links between overview and robots", () => {
  it("lead to a robot with all that stands behind the #, and back", () => {
    const there = robotPage("robots/arm-2/", "#token=x.y.z&name=Ann", BASE);
    expect(there).toBe("https://hall.example/a/robots/arm-2/#token=x.y.z&name=Ann&from=fleet");
    const url = new URL(there ?? "");
    expect(overviewPage(url.hash, url.href)).toBe("https://hall.example/a/#token=x.y.z&name=Ann");
  });

  it("lead back only where somebody came from the overview", () => {
    expect(overviewPage("#token=x", "https://hall.example/")).toBeNull();
    expect(overviewPage("#token=x&from=elsewhere", "https://hall.example/")).toBeNull();
  });

  it("lead to another console, but to nothing that is no page", () => {
    expect(robotPage("https://other.example/robots/b/", "#token=x", BASE)).toBe(
      "https://other.example/robots/b/#token=x&from=fleet",
    );
    for (const url of ["javascript:alert(1)", "data:text/html,x", "https://", "file:///etc/passwd"])
      expect(robotPage(url, "#token=x", BASE)).toBeNull();
  });

  it("tell what the fleet calls the robot of a page", () => {
    expect(robotName("https://hall.example/a/robots/arm-2/#token=x")).toBe("arm-2");
    expect(robotName("https://hall.example/#token=robots/x/")).toBe("");
  });

  it("show pictures only of this page's own origin", () => {
    expect(isOwnOrigin("robots/b/", BASE)).toBe(true);
    expect(isOwnOrigin("https://hall.example/b/robots/c/", BASE)).toBe(true);
    expect(isOwnOrigin("https://other.example/robots/b/", BASE)).toBe(false);
    expect(isOwnOrigin("https://", BASE)).toBe(false);
  });
});
