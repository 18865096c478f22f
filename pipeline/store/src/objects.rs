//! Objects in a bucket of an S3-compatible store.
//!
//! The address is `s3://bucket/prefix`. Credentials, region and endpoint come from the variables that other programs use too:
//! `AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY`, `AWS_SESSION_TOKEN`, `AWS_REGION`, `AWS_ENDPOINT_URL`, and `AWS_ALLOW_HTTP=true` for an endpoint
//! without TLS.
//!
//! There is no rename. An object appears complete or not at all, so whatever consists of several objects needs one that is written last, and
//! only if it does not exist yet ([`Bucket::create`]): its presence means that the others are complete.
//!
//! The client is asynchronous. Its runtime lives in this module: calls block, and may come from any thread that is not part of another
//! runtime. Failed requests are retried for up to a minute; errors say whether a later attempt may succeed ([`ObjectError::is_transient`]).

use crate::digest::Hashed;
use futures_util::StreamExt;
use object_store::aws::AmazonS3Builder;
use object_store::memory::InMemory;
use object_store::path::Path as Key;
use object_store::{ObjectStore, ObjectStoreExt, PutMode, PutPayload, RetryConfig, WriteMultipart};
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};
use tokio::runtime::{Builder, Runtime};

const SCHEME: &str = "s3://";
/// Size from which an object is uploaded in parts, and size of a part, bytes. With at most 10 000 parts, objects have up to 160 GB.
const PART_BYTES: usize = 16 << 20;
/// Parts of one object in flight.
const PARTS_AT_ONCE: usize = 4;
/// Repetitions of a failed request, with pauses that double from 0.1 s to 15 s.
const RETRIES_MAX: usize = 8;
/// Time after which a request is not repeated again.
const RETRY_TIME_MAX: Duration = Duration::from_secs(60);

/// A failure of an object store.
#[derive(Debug, thiserror::Error)]
pub enum ObjectError {
    /// An address that is not of the form `s3://bucket/prefix`.
    #[error("\"{0}\" is not the address of an object store; expected s3://bucket or s3://bucket/prefix")]
    Address(String),
    /// The environment does not describe a usable store.
    #[error("{address}: {source}; check the AWS_... variables")]
    Environment {
        /// The address.
        address: String,
        /// The cause.
        source: object_store::Error,
    },
    /// The environment holds no credentials, and the machine has no role that gives any.
    #[error(
        "{address}: no credentials; set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or run on a machine whose role may access the bucket"
    )]
    Credentials {
        /// The address.
        address: String,
    },
    /// A request failed.
    #[error("{address}: {}", in_words(source))]
    Request {
        /// The object or the bucket.
        address: String,
        /// The cause.
        source: object_store::Error,
    },
    /// A local file or the runtime failed.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
}

impl ObjectError {
    /// True if the same request may succeed later: the store does not answer, is overloaded, or failed itself.
    pub fn is_transient(&self) -> bool {
        let Self::Request { source: object_store::Error::Generic { source, .. }, .. } = self else { return false };
        // The type of this error is private to the client; refusals that it does not name otherwise have a status of 400 to 499 in their text.
        let text = source.to_string();
        let is_refusal = text.contains("status code: 4");
        !is_refusal || ["status code: 408", "status code: 429"].iter().any(|busy| text.contains(busy))
    }

    fn file(path: &Path) -> impl FnOnce(io::Error) -> Self + '_ {
        move |source| Self::File { path: path.to_owned(), source }
    }
}

/// What a store answered, without the document in which it says so.
fn in_words(error: &object_store::Error) -> String {
    use object_store::Error::{NotFound, PermissionDenied, Unauthenticated};
    let text = error.to_string();
    match error {
        PermissionDenied { .. } | Unauthenticated { .. } => {
            "access denied; check the AWS_... variables and their permissions on the bucket".to_owned()
        }
        NotFound { .. } if text.contains("NoSuchBucket") => "no such bucket".to_owned(),
        NotFound { .. } => "no such bucket or object".to_owned(),
        _ => text.split("<?xml").next().unwrap_or_default().trim_end_matches([':', ' ']).to_owned(),
    }
}

/// True for a failed request to the service that tells a machine its role, which is asked only without credentials in the environment.
fn asks_for_a_role(error: &str) -> bool {
    error.contains("/latest/api/token") || error.contains("/latest/meta-data/")
}

/// An object below the prefix of a bucket.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    /// Its name, relative to the prefix.
    pub name: String,
    /// Its size, bytes.
    pub bytes: u64,
    /// Time of its creation.
    pub modified: SystemTime,
}

/// A bucket, or the part of it below a prefix.
///
/// # Examples
/// ```
/// use sastrugi_store::objects::Bucket;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let bucket = Bucket::in_memory("s3://terrains/release")?;
/// assert!(bucket.create("manifest.json", b"{}")?);
/// // The first to create an object wins.
/// assert!(!bucket.create("manifest.json", b"[]")?);
///
/// let mut text = Vec::new();
/// assert!(bucket.read("manifest.json", &mut text)?);
/// assert_eq!(text, b"{}");
/// assert!(!bucket.read("README.md", &mut text)?);
/// assert!(Bucket::in_memory("release").is_err());
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Bucket {
    store: Arc<dyn ObjectStore>,
    address: String,
    prefix: String,
    runtime: Runtime,
}

impl Bucket {
    /// True for the address of a bucket.
    pub fn is_address(text: &str) -> bool {
        text.starts_with(SCHEME)
    }

    /// Opens a bucket as the environment describes it, and lists one object of it.
    ///
    /// # Errors
    /// A malformed address, an incomplete environment, no such bucket, no permission, or a store that does not answer.
    pub fn open(address: &str) -> Result<Self, ObjectError> {
        // An error means that the program has chosen another implementation before.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let (bucket, _) = parts(address)?;
        let retries = RetryConfig { max_retries: RETRIES_MAX, retry_timeout: RETRY_TIME_MAX, ..RetryConfig::default() };
        let store = AmazonS3Builder::from_env().with_bucket_name(bucket).with_retry(retries).build();
        let store = store.map_err(|source| ObjectError::Environment { address: address.to_owned(), source })?;
        let bucket = Self::new(Arc::new(store), address)?;
        match bucket.look() {
            Err(ObjectError::Request { source, .. }) if asks_for_a_role(&source.to_string()) => {
                Err(ObjectError::Credentials { address: address.to_owned() })
            }
            looked => looked.map(|()| bucket),
        }
    }

    /// A bucket in the memory of this process, for tests of what uses one.
    ///
    /// # Errors
    /// A malformed address.
    pub fn in_memory(address: &str) -> Result<Self, ObjectError> {
        Self::new(Arc::new(InMemory::new()), address)
    }

    fn new(store: Arc<dyn ObjectStore>, address: &str) -> Result<Self, ObjectError> {
        let (_, prefix) = parts(address)?;
        let runtime =
            Builder::new_current_thread().enable_all().build().map_err(ObjectError::file(Path::new(address)))?;
        Ok(Self { store, address: address.trim_end_matches('/').to_owned(), prefix: prefix.to_owned(), runtime })
    }

    /// Its address.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Requests the first objects, which fails if the bucket cannot be read.
    fn look(&self) -> Result<(), ObjectError> {
        let first = self.runtime.block_on(self.store.list(self.folder("")?.as_ref()).next());
        first.transpose().map(drop).map_err(|source| self.request("", source))
    }

    /// The key of an object.
    fn key(&self, name: &str) -> Result<Key, ObjectError> {
        let path = format!("{}/{name}", self.prefix);
        Key::parse(path.trim_matches('/')).map_err(|_| ObjectError::Address(format!("{}/{name}", self.address)))
    }

    /// The key of a folder; `None` for a bucket as a whole.
    fn folder(&self, name: &str) -> Result<Option<Key>, ObjectError> {
        Ok(Some(self.key(name)?).filter(|key| !key.as_ref().is_empty()))
    }

    fn request(&self, name: &str, source: object_store::Error) -> ObjectError {
        let address = format!("{}/{name}", self.address).trim_end_matches('/').to_owned();
        ObjectError::Request { address, source }
    }

    /// True if an object exists.
    ///
    /// # Errors
    /// The request failed.
    pub fn contains(&self, name: &str) -> Result<bool, ObjectError> {
        match self.runtime.block_on(self.store.head(&self.key(name)?)) {
            Ok(_) => Ok(true),
            Err(object_store::Error::NotFound { .. }) => Ok(false),
            Err(source) => Err(self.request(name, source)),
        }
    }

    /// Copies an object; false if it does not exist.
    ///
    /// # Errors
    /// A request failed, or `to` cannot be written.
    pub fn read(&self, name: &str, to: &mut dyn Write) -> Result<bool, ObjectError> {
        let key = self.key(name)?;
        self.runtime.block_on(async {
            let mut chunks = match self.store.get(&key).await {
                Ok(found) => found.into_stream(),
                Err(object_store::Error::NotFound { .. }) => return Ok(false),
                Err(source) => return Err(self.request(name, source)),
            };
            while let Some(chunk) = chunks.next().await {
                let chunk = chunk.map_err(|source| self.request(name, source))?;
                to.write_all(&chunk).map_err(ObjectError::file(Path::new(name)))?;
            }
            Ok(true)
        })
    }

    /// SHA-256 of an object; `None` if it does not exist.
    ///
    /// # Errors
    /// A request failed.
    pub fn sha256(&self, name: &str) -> Result<Option<String>, ObjectError> {
        let mut hashed = Hashed::new(io::sink());
        let is_there = self.read(name, &mut hashed)?;
        Ok(is_there.then(|| hashed.finish().2))
    }

    /// Creates an object in one request; false if it exists already and stays as it is. Stores take up to 5 GB.
    ///
    /// # Errors
    /// The request failed.
    pub fn create(&self, name: &str, bytes: &[u8]) -> Result<bool, ObjectError> {
        self.put(name, bytes.to_vec(), PutMode::Create)
    }

    /// Creates an object from a file; false if it exists already and stays as it is. Of two that create a file above 16 MiB at the same time,
    /// the last wins.
    ///
    /// # Errors
    /// A request failed, or the file cannot be read.
    pub fn create_from(&self, name: &str, path: &Path) -> Result<bool, ObjectError> {
        self.upload(name, path, PutMode::Create)
    }

    /// Creates or replaces an object from a file.
    ///
    /// # Errors
    /// As [`Bucket::create_from`].
    pub fn replace_from(&self, name: &str, path: &Path) -> Result<(), ObjectError> {
        self.upload(name, path, PutMode::Overwrite).map(drop)
    }

    fn put(&self, name: &str, bytes: Vec<u8>, mode: PutMode) -> Result<bool, ObjectError> {
        let key = self.key(name)?;
        match self.runtime.block_on(self.store.put_opts(&key, PutPayload::from(bytes), mode.into())) {
            Ok(_) => Ok(true),
            Err(object_store::Error::AlreadyExists { .. }) => Ok(false),
            Err(source) => Err(self.request(name, source)),
        }
    }

    fn upload(&self, name: &str, path: &Path, mode: PutMode) -> Result<bool, ObjectError> {
        let size = std::fs::metadata(path).map_err(ObjectError::file(path))?.len();
        if size < PART_BYTES as u64 {
            let bytes = crate::file::read(path).map_err(ObjectError::file(path))?;
            return self.put(name, bytes, mode);
        }
        // Parts cannot be conditional.
        if mode == PutMode::Create && self.contains(name)? {
            return Ok(false);
        }
        let mut file = crate::file::open(path).map_err(ObjectError::file(path))?;
        self.runtime.block_on(self.upload_parts(name, &mut file, path))?;
        Ok(true)
    }

    async fn upload_parts(&self, name: &str, file: &mut File, path: &Path) -> Result<(), ObjectError> {
        let upload = self.store.put_multipart(&self.key(name)?).await.map_err(|source| self.request(name, source))?;
        let mut writer = WriteMultipart::new_with_chunk_size(upload, PART_BYTES);
        let mut buffer = vec![0; 1 << 18];
        loop {
            let read = match file.read(&mut buffer) {
                Ok(0) => break,
                Ok(read) => read,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
                Err(e) => {
                    // Parts that stay are removed by the bucket's own rules.
                    let _ = writer.abort().await;
                    return Err(ObjectError::file(path)(e));
                }
            };
            let ready = writer.wait_for_capacity(PARTS_AT_ONCE).await;
            if let Err(source) = ready {
                let _ = writer.abort().await;
                return Err(self.request(name, source));
            }
            writer.write(&buffer[..read]);
        }
        writer.finish().await.map(drop).map_err(|source| self.request(name, source))
    }

    /// The objects in a folder and below, sorted by name.
    ///
    /// # Errors
    /// A request failed.
    pub fn list(&self, folder: &str) -> Result<Vec<Object>, ObjectError> {
        let key = self.folder(folder)?;
        let found: Vec<Result<_, _>> = self.runtime.block_on(self.store.list(key.as_ref()).collect());
        let mut objects = Vec::with_capacity(found.len());
        for meta in found {
            let meta = meta.map_err(|source| self.request(folder, source))?;
            let path = meta.location.as_ref();
            let name = path.strip_prefix(&self.prefix).unwrap_or(path).trim_start_matches('/').to_owned();
            objects.push(Object { name, bytes: meta.size, modified: meta.last_modified.into() });
        }
        objects.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(objects)
    }

    /// Removes an object; success if it does not exist.
    ///
    /// # Errors
    /// The request failed.
    pub fn remove(&self, name: &str) -> Result<(), ObjectError> {
        match self.runtime.block_on(self.store.delete(&self.key(name)?)) {
            Ok(()) | Err(object_store::Error::NotFound { .. }) => Ok(()),
            Err(source) => Err(self.request(name, source)),
        }
    }
}

/// Bucket and prefix of an address.
fn parts(address: &str) -> Result<(&str, &str), ObjectError> {
    let refused = || ObjectError::Address(address.to_owned());
    let rest = address.strip_prefix(SCHEME).ok_or_else(refused)?.trim_end_matches('/');
    let (bucket, prefix) = rest.split_once('/').unwrap_or((rest, ""));
    let is_path = prefix.is_empty() || Key::parse(prefix).is_ok_and(|key| key.as_ref() == prefix);
    if bucket.is_empty() || !is_path { Err(refused()) } else { Ok((bucket, prefix)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_addresses() {
        assert_eq!(parts("s3://bucket").unwrap(), ("bucket", ""));
        assert_eq!(parts("s3://bucket/").unwrap(), ("bucket", ""));
        assert_eq!(parts("s3://bucket/a/b-1.2/").unwrap(), ("bucket", "a/b-1.2"));
        for wrong in ["bucket", "s3:/bucket", "s3://", "s3:///a", "s3://bucket//a", "s3://bucket/a/../b", "S3://bucket"]
        {
            let error = parts(wrong).unwrap_err();
            assert!(
                error.to_string().starts_with(&format!("\"{wrong}\" is not the address of an object store")),
                "{wrong}: {error}"
            );
            assert!(!error.is_transient());
        }
        assert!(Bucket::is_address("s3://x") && !Bucket::is_address("release") && !Bucket::is_address("./s3://x"));
    }

    /// Small and large files come back as they were, a second creation changes nothing, and names are relative to the prefix.
    #[test]
    fn val_objects_are_created_once_and_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, size: usize| {
            let bytes: Vec<u8> = (0..size).map(|k| (k % 251) as u8).collect();
            std::fs::write(folder.path().join(name), &bytes).unwrap();
            (folder.path().join(name), bytes)
        };
        for address in ["s3://bucket", "s3://bucket/some/where"] {
            let bucket = Bucket::in_memory(address).unwrap();
            for (name, size) in [("empty", 0), ("small", 1000), ("large", 2 * PART_BYTES + 7)] {
                let (path, bytes) = file(name, size);
                let object = format!("files/{name}");
                assert!(!bucket.contains(&object).unwrap());
                assert!(bucket.create_from(&object, &path).unwrap() && bucket.contains(&object).unwrap());
                let (other, changed) = file("other", size + 1);
                assert!(!bucket.create_from(&object, &other).unwrap());
                let read = || {
                    let mut read = Vec::new();
                    assert!(bucket.read(&object, &mut read).unwrap());
                    read
                };
                assert!(read() == bytes, "{name} was changed");
                assert_eq!(bucket.sha256(&object).unwrap(), Some(crate::digest::of_bytes(&bytes)));
                bucket.replace_from(&object, &other).unwrap();
                assert!(read() == changed, "{name} was not replaced");
            }
            assert!(bucket.create("top", b"x").unwrap());
            let names = |folder: &str| -> Vec<(String, u64)> {
                bucket.list(folder).unwrap().into_iter().map(|object| (object.name, object.bytes)).collect()
            };
            let large = (2 * PART_BYTES + 8) as u64;
            let files = [("files/empty", 1), ("files/large", large), ("files/small", 1001)];
            assert_eq!(names("files"), files.map(|(name, bytes)| (name.to_owned(), bytes)));
            assert_eq!((names("").len(), names("fil").len()), (4, 0));
            bucket.remove("files/large").unwrap();
            bucket.remove("files/large").unwrap();
            assert_eq!((names("").len(), bucket.sha256("files/large").unwrap()), (3, None));
        }
    }

    /// Calls come from many threads at once.
    #[test]
    fn val_one_of_many_creates_an_object() {
        let bucket = Bucket::in_memory("s3://bucket").unwrap();
        let created = std::thread::scope(|scope| {
            let bucket = &bucket;
            let create = |k: u8| scope.spawn(move || bucket.create("x", &[k]).unwrap());
            let all: Vec<_> = (0..8).map(create).collect();
            all.into_iter().map(|one| one.join().unwrap()).filter(|is_first| *is_first).count()
        });
        assert_eq!(created, 1);
    }

    /// A name that would leave the prefix is refused before any request.
    #[test]
    fn val_names_stay_below_the_prefix() {
        let bucket = Bucket::in_memory("s3://bucket/a").unwrap();
        for name in ["../b", "b/../../c", "b//c", "."] {
            assert!(matches!(bucket.contains(name), Err(ObjectError::Address(_))), "{name}");
        }
    }

    /// A store answers with an XML document, of which a user gets the sentence.
    #[test]
    fn val_answers_are_told_in_words() {
        let xml = "<?xml version=\"1.0\"?><Error><Code>NoSuchBucket</Code></Error>";
        let said =
            |source: object_store::Error| ObjectError::Request { address: "s3://b".to_owned(), source }.to_string();
        let missing = |body: &str| object_store::Error::NotFound { path: "x".to_owned(), source: body.into() };
        assert_eq!(said(missing(xml)), "s3://b: no such bucket");
        assert_eq!(said(missing("404")), "s3://b: no such bucket or object");
        let denied = object_store::Error::PermissionDenied { path: "x".to_owned(), source: xml.into() };
        assert!(said(denied).starts_with("s3://b: access denied; check the AWS_"));
        let body = format!("Server returned non-2xx status code: 400 Bad Request: {xml}");
        let other = object_store::Error::Generic { store: "S3", source: body.into() };
        assert!(said(other).ends_with("status code: 400 Bad Request"));
    }

    /// Whether to try again follows from the cause.
    #[test]
    fn val_only_some_requests_are_transient() {
        let of =
            |source: object_store::Error| ObjectError::Request { address: "s3://b".to_owned(), source }.is_transient();
        let generic = |text: &str| object_store::Error::Generic { store: "S3", source: text.into() };
        assert!(of(generic("error sending request")));
        assert!(of(generic("Server returned non-2xx status code: 503 Service Unavailable")));
        assert!(of(generic("Server returned non-2xx status code: 429 Too Many Requests")));
        assert!(!of(generic("Server returned non-2xx status code: 400 Bad Request")));
        let refused = object_store::Error::PermissionDenied { path: "x".to_owned(), source: "no".into() };
        assert!(!of(refused));
    }
}
