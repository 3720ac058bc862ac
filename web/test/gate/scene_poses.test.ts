import { describe, expect, it } from "vitest";
import { createScenePoses, forgetPoses, keepPose, poseDue, type ScenePose } from "../../src/gate/scene_poses";
import { MAX_EVENT } from "../../src/gate/serial";

function pose(event: number, joint = event): ScenePose {
  return { event, goals: [], joints: [joint], wrench: [], ranges: [], limits: [], unknown: [] };
}

describe("the poses that the page's own drawing has to choose from", () => {
  it("has that of the picture's event, not the newest", () => {
    const poses = createScenePoses();
    for (const event of [5, 6, 7, 9]) keepPose(poses, pose(event));
    expect(poseDue(poses, 6)?.event).toBe(6);
    expect(poseDue(poses, 8)?.event).toBe(7);
    expect(poseDue(poses, "all")?.event).toBe(9);
  });

  it("has none newer than the event that is due, and none before anything is known", () => {
    const poses = createScenePoses();
    expect(poseDue(poses, "all")).toBeNull();
    keepPose(poses, pose(5));
    expect(poseDue(poses, 4)).toBeNull();
    expect(poseDue(poses, null)).toBeNull();
  });

  it("has the newest feedback of an event", () => {
    const poses = createScenePoses();
    keepPose(poses, pose(5, 0.1));
    keepPose(poses, pose(5, 0.2));
    expect(poses.kept.length).toBe(1);
    expect(poseDue(poses, 5)?.joints).toEqual([0.2]);
  });

  it("keeps a bounded number, the newest, also where event numbers begin anew", () => {
    const poses = createScenePoses();
    for (let step = 0; step < 300; step += 1)
      keepPose(poses, pose((MAX_EVENT - 100 + step) % (MAX_EVENT + 1)));
    expect(poses.kept.length).toBe(200);
    expect(poseDue(poses, MAX_EVENT)?.event).toBe(MAX_EVENT);
    forgetPoses(poses);
    expect(poseDue(poses, "all")).toBeNull();
  });
});
