from lockstep.server.control.known_issues import KNOWN_ISSUES, KnownIssues
from tests.makers import feedback


def test_the_newest_issues_of_the_current_event_are_known_by_their_nonce() -> None:
    issues = KnownIssues()
    for issue in range(KNOWN_ISSUES + 1):
        issues.add(feedback(7, issue=issue, nonce=100 + issue))
    assert (issues.nonce(0), issues.nonce(1), issues.nonce(KNOWN_ISSUES)) == (None, 101, 100 + KNOWN_ISSUES)
    issues.add(feedback(8, issue=KNOWN_ISSUES + 1, nonce=5))
    assert (issues.nonce(KNOWN_ISSUES), issues.nonce(KNOWN_ISSUES + 1)) == (None, 5)
    issues.clear()
    assert issues.nonce(KNOWN_ISSUES + 1) is None
