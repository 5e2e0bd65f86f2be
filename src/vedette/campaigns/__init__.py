"""Monte Carlo campaigns: many runs of many settings, on one machine or many, stored in a crash-safe folder."""

from vedette.internal.extras import require_packages

require_packages("a campaign", "pyarrow")

from vedette.campaigns.cells import Campaign, Cell, resolve
from vedette.campaigns.merging import MergeResult, merge
from vedette.campaigns.progress import Progress
from vedette.campaigns.results import CampaignResults, open_results
from vedette.campaigns.running import CampaignOutcome, ProgressObserver, run_campaign
from vedette.campaigns.shards import Shard, parse_shard
from vedette.campaigns.spec import CampaignSpec, Variant, load_spec, parse_spec
from vedette.campaigns.tasks import CompletedRun, FailedRun

__all__ = [
    "Campaign",
    "CampaignOutcome",
    "CampaignResults",
    "CampaignSpec",
    "Cell",
    "CompletedRun",
    "FailedRun",
    "MergeResult",
    "Progress",
    "ProgressObserver",
    "Shard",
    "Variant",
    "load_spec",
    "merge",
    "open_results",
    "parse_shard",
    "parse_spec",
    "resolve",
    "run_campaign",
]
