"""Settings of episodes: LOCKSTEP_EPISODES__…"""

from pydantic import BaseModel, Field

__all__ = ["EpisodeSettings"]


class EpisodeSettings(BaseModel):
    countdown_seconds: float = Field(default=3.0, ge=0, le=60)  # from the request to the begin; 0: at once
    reset_action: str = Field(default="", max_length=60)  # action of the robot that is run after each episode
    reset_seconds: float = Field(default=30.0, gt=0, le=600)  # then the reset counts as failed
